"""Files are written as a whole or not at all, whatever happens meanwhile; large ones are read within bounded memory."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
import tracemalloc

import numpy as np
import pytest
from conftest import make_log

import stablepush as sp
from stablepush.io.json_files import open_text
from stablepush.io.writing import write_atomically, write_json

WRITER = """
import sys
from stablepush.io import write_json
word, target = sys.argv[1:]
print("ready", flush=True)
while True:
    write_json(target, {"word": word, "numbers": [len(word)] * 200_000})
"""


def writer(word, target):
    process = subprocess.Popen([sys.executable, "-c", WRITER, word, str(target)], stdout=subprocess.PIPE)
    process.stdout.readline()
    return process


def whole(target):
    value = json.loads(target.read_text(encoding="utf-8"))
    return value["numbers"] == [len(value["word"])] * 200_000


def test_two_processes_that_write_one_file_leave_one_or_the_other(tmp_path):
    target = tmp_path / "one output.json"
    both = [writer(word, target) for word in ("first", "the other")]
    try:
        until, seen = time.monotonic() + 20, set()
        while time.monotonic() < until and len(seen) < 2:
            if target.exists():
                assert whole(target)
                seen.add(json.loads(target.read_text(encoding="utf-8"))["word"])
        assert seen == {"first", "the other"}
    finally:
        for process in both:
            process.kill()
            process.communicate()


def test_a_killed_process_leaves_the_old_file_or_the_new_one(tmp_path):
    target = tmp_path / "out.json"
    rng = np.random.default_rng(0)
    for _ in range(6):
        process = writer("killed", target)
        time.sleep(float(rng.uniform(0.0, 0.15)))
        process.send_signal(signal.SIGKILL)
        process.communicate()
        assert not target.exists() or whole(target)
    process = writer("killed", target)
    while not target.exists():
        time.sleep(0.01)
    process.kill()
    process.communicate()
    assert whole(target)


@pytest.mark.parametrize("before", (None, "the old one"))
def test_a_full_disk_is_one_line_and_changes_nothing(tmp_path, before):
    """A limit of the size of files stands for the disk: both make a write fail half way."""
    target = tmp_path / "out.txt"
    if before is not None:
        target.write_text(before, encoding="utf-8")
    log = make_log(count=16)  # builds compiled code, which a full disk could not keep
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
        with pytest.raises(sp.InputError, match=r"out.txt: cannot write: File too large"):
            write_atomically(target, "x" * 50_000)
        with pytest.raises(sp.InputError, match=r"cannot write"):
            sp.write_pushlog(log, tmp_path / "log")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, handler)
    assert sorted(p.name for p in tmp_path.iterdir()) == ([] if before is None else ["out.txt"])
    assert before is None or target.read_text(encoding="utf-8") == before


def test_ctrl_c_while_writing_leaves_nothing(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_json(tmp_path / "out.json", {})
    assert list(tmp_path.iterdir()) == []


def test_a_long_log_is_read_in_little_more_memory_than_its_numbers_take(tmp_path):
    log = make_log(count=20, rows=1500)
    sp.write_pushlog(log, tmp_path)
    numbers = sum(8 * len(values) for values in log.samples.values())
    tracemalloc.start()
    again = sp.read_pushlog(tmp_path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 3 * numbers
    for name, values in log.samples.items():
        assert np.array_equal(again.samples[name], values, equal_nan=values.dtype != object)


@pytest.mark.skipif(not os.path.exists("/dev/fd"), reason="pipes of the shell have no path here")
def test_a_pipe_of_the_shell_is_read_and_bad_text_refused():
    """It cannot be read twice to tell the byte."""
    for text in (b"a,b\n", b"a,b\n\xff\n"):
        reading, writing = os.pipe()
        os.write(writing, text)
        os.close(writing)
        if text.isascii():
            with open_text(f"/dev/fd/{reading}") as stream:
                assert stream.read() == "a,b\n"
        else:
            with pytest.raises(sp.InputError, match=f"fd/{reading}: expected UTF-8"), open_text(f"/dev/fd/{reading}") as stream:
                stream.read()
        os.close(reading)


def test_text_that_is_not_utf8_is_told_by_its_byte(tmp_path):
    path = tmp_path / "bad.csv"
    path.write_bytes(b"a,b\n" * 5000 + b"\xff\n")
    with pytest.raises(sp.InputError, match="byte 20000: expected UTF-8"), open_text(path) as stream:
        for _ in stream:
            pass
