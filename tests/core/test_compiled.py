"""Machine code that is kept on disk."""

import os
import subprocess
import sys
from contextlib import ExitStack
from functools import partial
from importlib import import_module

import numpy as np
import pytest
from numba.core.errors import TypingError

from stablepush.core import BuildLock, isolated_environment, start_child
from stablepush.core.compiled import _checksum

SOURCE = """
from stablepush.core import compiled


@compiled
def twice(x):
    return 2 * x
"""
THRICE = """

@compiled
def thrice(x):
    return 3 * x
"""


def _flipped(data: bytes) -> bytes:
    return data[:-7] + bytes([data[-7] ^ 0xFF]) + data[-6:]


SPOILT = {
    "empty": lambda data: b"",
    "half": lambda data: data[: len(data) // 2],
    "no pickle": lambda data: b"no pickle",
    "flipped": _flipped,
    "zeros": lambda data: bytes(len(data)),
    "zero tail": lambda data: data[: len(data) // 2] + bytes(len(data) - len(data) // 2),
    "random": lambda data: np.random.default_rng(0).bytes(len(data)),
}


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("how", SPOILT)
def test_kept_code_that_is_spoilt_is_built_again(tmp_path, monkeypatch, how, ending):
    (tmp_path / "kept_code.py").write_text(SOURCE, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    whole = None
    for _ in range(3):
        sys.modules.pop("kept_code", None)
        assert import_module("kept_code").twice(3.0) == 6.0
        kept = list(tmp_path.rglob(f"*.{ending}"))
        if not kept:
            pytest.skip("compiling is turned off")
        if whole is not None:
            # written anew
            assert kept[0].read_bytes() != SPOILT[how](whole)
        whole = kept[0].read_bytes()
        kept[0].write_bytes(SPOILT[how](whole))
    sys.modules.pop("kept_code", None)


def of_other_types(path):
    """As after an upgrade: whole, and of types that are gone."""
    path.write_bytes(_checksum(path, gone := b"cstablepush.core\nNoSuchType\n.") + gone)


def folder(path):
    path.unlink()
    path.mkdir()


def pipe(path):
    path.unlink()
    os.mkfifo(path)


def anothers(path):
    """As after a copy that confused names: whole, and another function's."""
    other = next(file for file in path.parent.glob(f"*{path.suffix}") if file != path and "thrice" in file.name)
    path.write_bytes(other.read_bytes())


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("spoil", [of_other_types, folder, pipe, anothers])
def test_what_takes_the_place_of_kept_code_is_replaced(tmp_path, monkeypatch, spoil, ending):
    if spoil is pipe and not hasattr(os, "mkfifo"):
        pytest.skip("no pipes here")
    (tmp_path / "kept_code.py").write_text(SOURCE + THRICE, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    for run in range(2):
        sys.modules.pop("kept_code", None)
        code = import_module("kept_code")
        assert (code.twice(3.0), code.thrice(3.0)) == (6.0, 9.0)
        kept = [file for file in tmp_path.rglob(f"*.{ending}") if "twice" in file.name]
        if not kept:
            pytest.skip("compiling is turned off")
        assert kept[0].is_file()
        if run == 0:
            spoil(kept[0])
    sys.modules.pop("kept_code", None)


no_code = pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT", "0") != "0", reason="compiling is turned off")

SHARED = """
import sys
import time
from numba.core import event
from stablepush.core import compiled, inner


@inner
def power(x, n):
    result = 1.0
    for _ in range(n):
        result *= x
    return result


@compiled
def cube_and_square(x):
    return power(x, 3) + power(x, 2)


class Counter(event.Listener):
    built = []

    def on_start(self, started):
        self.built.append(started.data["dispatcher"].py_func.__name__)
        time.sleep(0.2)

    def on_end(self, ended):
        pass


if __name__ == "__main__":
    event.register("numba:compile", Counter())
    print("ready", flush=True)
    sys.stdin.readline()
    assert cube_and_square(2.0) == 12.0
    print(sorted(name for name in Counter.built if name in ("power", "cube_and_square")))
"""


def python(*arguments, **others):
    return subprocess.Popen(
        [sys.executable, *map(str, arguments)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **others
    )


@no_code
def test_processes_build_a_function_once_for_all_and_for_all_values(tmp_path):
    """A function of two constants is one function, and four processes that need it at the same time build it once."""
    program = tmp_path / "shared_code.py"
    program.write_text(SHARED, encoding="utf-8")
    with ExitStack() as stack:
        start = partial(python, program, env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)})
        processes = [stack.enter_context(start()) for _ in range(4)]
        for process in processes:
            assert process.stdout.readline() == "ready\n"
        for process in processes:
            process.stdin.write("go\n")
            process.stdin.flush()
        built = sorted(process.stdout.readline().strip() for process in processes)
    assert built == ["['cube_and_square', 'power']", "[]", "[]", "[]"]


def test_a_lock_is_held_by_one_process_until_it_ends(tmp_path):
    hold = (
        "import sys\nfrom stablepush.core import BuildLock\nlock = BuildLock(sys.argv[1], 'f')\nlock.acquire()\n"
        "print(lock.held, flush=True)\nsys.stdin.readline()"
    )
    lock, free = BuildLock(str(tmp_path), "f"), BuildLock(str(tmp_path), "g")
    with python("-c", hold, tmp_path) as other:
        assert other.stdout.readline() == "True\n"
        lock.acquire(timeout=0.1)
        free.acquire(timeout=0.1)
        assert (lock.held, free.held) == (False, True)
        other.kill()
    lock.acquire()
    assert lock.held
    lock.release()
    free.release()
    assert not lock.held


def test_what_cannot_be_locked_is_built_all_the_same(tmp_path):
    (tmp_path / "file").write_text("")
    lock = BuildLock(str(tmp_path / "file" / "folder"), "f")
    lock.acquire()
    assert not lock.held
    lock.release()


FAILING = """
from stablepush.core import compiled, inner


@inner
def half(x):
    return x / 2


@compiled
def quarter(x):
    return half(half(x))
"""


@no_code
def test_who_fails_to_build_releases_the_lock(tmp_path, monkeypatch):
    (tmp_path / "failing_code.py").write_text(FAILING, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    code = import_module("failing_code")
    with pytest.raises(TypingError):
        code.quarter("word")
    assert not code.quarter._cache.lock.held
    assert not code.half._cache.lock.held
    assert code.quarter(4.0) == 1.0


@no_code
def test_code_of_another_source_is_never_read_under_its_name(tmp_path):
    """As if a process were killed after one of the two files of a function was written, or another looked between the two."""
    program = tmp_path / "changing_code.py"
    run = partial(subprocess.run, [sys.executable, program], capture_output=True, text=True, check=False)
    text = "import sys, os\nfrom stablepush.core import compiled\nfrom stablepush.core.compiled import _Files\n{}\n\n"
    text += "@compiled\ndef plus(x):\n    return x + {}\n\n\nprint(plus(1.0))\n"
    program.write_text(text.format("", 1))
    assert run().stdout == "2.0\n"
    for name in ("_save_data", "_save_index"):
        program.write_text(text.format(f"_Files.{name} = lambda *_: os._exit(9)", 100))
        assert run().returncode == 9
        program.write_text(text.format("", 100))
        assert run().stdout == "101.0\n"
        program.write_text(text.format("", 1))
        assert run().stdout == "2.0\n"


def test_a_process_does_not_wait_again_and_again(tmp_path, monkeypatch):
    monkeypatch.setattr(BuildLock, "timeout", 0.2)
    monkeypatch.setattr(BuildLock, "_lock", lambda self: False)
    for name in ("f", "g"):
        BuildLock(str(tmp_path), name).acquire()
    assert BuildLock.timeout == 0.0


def test_a_helper_ends_with_its_parent_and_reads_no_module_of_the_current_folder(tmp_path, monkeypatch):
    for name in ("numba", "random", "stablepush"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(77)")
    monkeypatch.chdir(tmp_path)
    helper = start_child("stablepush.cli.building", ["0"])
    helper.stdin.write("\n")
    helper.stdin.flush()
    with helper:
        helper.stdin.close()
        assert helper.wait(timeout=120) == 1
    found = subprocess.run([sys.executable, "-c", "import numba"], env=isolated_environment(), check=False)
    assert found.returncode == 0


@no_code
def test_all_code_is_built_by_a_command():
    ask = (
        "from stablepush.cli import main\nassert main(['compile']) == 0\n"
        "from stablepush.mechanics.kernels.rollout import run\nfrom stablepush_planners._search import expand\n"
        "from stablepush.identify.kernels.pressure_draws import weigh\n"
        "from stablepush.diagnosis.likelihood.sensor_readings import read\n"
        "print([len(f.overloads) for f in (run, expand, weigh, read)])"
    )
    with python("-c", ask) as process:
        assert process.stdout.read().splitlines()[-1] == "[1, 1, 1, 1]"


def test_nothing_is_built_where_nothing_is_kept():
    command = [sys.executable, "-m", "stablepush", "compile"]
    done = subprocess.run(command, env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n"), "NUMBA_DISABLE_JIT" in done.stderr) == (2, 1, True)


def test_children_run_the_same_copy_of_the_package(tmp_path):
    """Another copy that comes first on the path of a child is not run: figures would be of other code than was asked for."""
    import stablepush

    other = tmp_path / "first" / "stablepush"
    other.mkdir(parents=True)
    (other / "__init__.py").write_text("raise SystemExit('the other copy was run')\n")
    probe = tmp_path / "probe"
    probe.mkdir()
    (probe / "where_from.py").write_text(
        "import sys, stablepush.core as core\nopen(sys.argv[1], 'w').write(core.__file__)\n", encoding="utf-8"
    )
    told = tmp_path / "told"
    code = (
        "import os, sys; from stablepush.core import start_child; "
        f"sys.path[:0] = [{str(tmp_path / 'first')!r}, {str(probe)!r}]; "
        f"sys.exit(start_child('where_from', [{str(told)!r}]).wait())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert os.path.dirname(told.read_text()) == os.path.join(os.path.dirname(stablepush.__file__), "core")
