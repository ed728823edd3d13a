"""Kills commands that write, at random times: the old output is there afterwards, or the new one, whole, and nothing else.

    python tests/cli/killing.py [--kills 10] [--seed 0] [--commands plan fit ...]

Each command runs to its end once, and is then killed, now with its output there already, now without, by SIGTERM, SIGHUP or
SIGKILL. After SIGTERM and SIGHUP no process, scratch file or temporary folder may be left. SIGKILL cannot be caught: after it no
process may be left, and after the next run nothing else.
"""

from __future__ import annotations

import argparse
import base64
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
from fuzzing import commands, seeds

import stablepush as sp

SIGNALS = (signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)
#: Seconds that processes of a command have to end after it.
PATIENCE = 10.0
#: What marks the processes of a command in their environment.
MARK = "STABLEPUSH_KILLED"


def writers(at: dict[str, Path], out: Path) -> dict[str, list[object]]:
    """Arguments of commands that write, by a name."""
    found = {name: arguments for name, (_, arguments) in commands(at, out).items() if name not in ("check", "blind")}
    scene, plan, log = at["scene"], at["plan"], at["log"]
    found["plan, page and picture"] = [
        "plan",
        scene,
        "-o",
        out,
        "--view",
        out.with_suffix(".html"),
        "--picture",
        out.with_suffix(".png"),
    ]
    found["diagnose, all"] = [
        "diagnose", log, "--json", out, "--html", out.with_suffix(".html"), "--mended", out.with_suffix(".mended"),
    ]  # fmt: skip
    if "bag" in at:
        found["trajectory, bag"] = ["trajectory", scene, plan, "--height", "0.1", "--rosbag", out.with_suffix(".bag")]
    if "check" in at:
        found["blind"] = ["blind", "-o", out.with_suffix(".check"), "--sets", "2", "--pushes", "6", "--generator", "mujoco"]
    found["demo"] = ["demo", "-o", out.with_suffix(".demo")]
    return found


def whole(path: Path) -> bool:
    """Whether a file is one that its writer finished."""
    data = path.read_bytes()
    if data.startswith(b"{"):
        for value in data.splitlines() if path.suffix == ".jsonl" else [data]:
            json.loads(value)
        return True
    if path.suffix == ".sealed" or path.name == "key":
        # whole groups of base64, which a seal and its key are
        return len(data) % 4 == 0 and len(base64.urlsafe_b64decode(data)) >= 32
    if path.name == "lock":
        return True
    ends = {".html": b"</html>", ".png": b"IEND\xaeB`\x82", ".gif": b";", ".yaml": b"", ".db3": b""}
    # tables, whatever they are called
    data = data.rstrip(b"\n") if path.suffix == ".html" else data
    return data.endswith(ends.get(path.suffix, b"\n"))


def files_of(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def processes(mark: str) -> list[int]:
    """Processes whose environment has a mark."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                if f"{MARK}={mark}".encode() in (entry / "environ").read_bytes():
                    found.append(int(entry.name))
            except OSError:
                continue
    return found


def run(
    arguments: list[object], temporary: Path, kill: signal.Signals | None = None, after: float = 0.0
) -> tuple[int, list[int]]:
    """Run a command, killed after so many seconds; its exit code, and its processes that still run."""
    mark = uuid.uuid4().hex
    child = subprocess.Popen(
        [sys.executable, "-m", "stablepush", *map(str, arguments)],
        env=os.environ | {MARK: mark, "TMPDIR": str(temporary)},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    if kill is not None:
        try:
            child.wait(after)
        except subprocess.TimeoutExpired:
            child.send_signal(kill)
    code = child.wait()
    end = time.monotonic() + PATIENCE
    while (left := processes(mark)) and time.monotonic() < end:
        time.sleep(0.05)
    for number in left:
        os.kill(number, signal.SIGKILL)
    return code, left


def killed(
    name: str, arguments: Callable[[Path], list[object]], folder: Path, kills: int, rng: np.random.Generator
) -> Counter[str]:
    """Kill a command so often; what was found."""
    found: Counter[str] = Counter()
    temporary, place = folder / "tmp", folder / "place"
    for each in (temporary, place):
        shutil.rmtree(each, ignore_errors=True)
        each.mkdir()
    began = time.monotonic()
    code, _ = run(arguments(place), temporary)
    lasts = time.monotonic() - began
    assert code in (0, 1), f"{name}: exit code {code}"
    old = files_of(place)
    assert old or name in ("check",), f"{name} wrote nothing"
    shutil.copytree(place, folder / "old", dirs_exist_ok=False)
    for number in range(kills):
        shutil.rmtree(place)
        if number % 2:
            shutil.copytree(folder / "old", place)
        else:
            place.mkdir()
        kill = SIGNALS[int(rng.integers(len(SIGNALS)))]
        # often near the end, where it writes
        after = lasts * (rng.uniform(0.0, 1.0) if rng.random() < 0.4 else rng.uniform(0.7, 0.95))
        code, left = run(arguments(place), temporary, kill, after)
        found["kills"] += 1
        found["ended before" if code in (0, 1) else f"by {kill.name}"] += 1
        if left:
            found[f"PROCESSES LEFT ({kill.name})"] += 1
        now = files_of(place)
        scratch = [path for path in now if any(part.startswith(".") for part in Path(path).parts)]
        lost = [path for path in old if path not in now] if number % 2 else []
        for path in set(now) - set(scratch):
            if path not in old:
                found[f"STRANGE FILE {path}"] += 1
            elif not whole(place / path):
                found[f"HALF A FILE {path}"] += 1
        if lost:
            found[f"LOST {', '.join(lost[:3])}"] += 1
        for log in {Path(path).parent for path in now if path.endswith("trials.csv") and path not in scratch}:
            sp.read_pushlog(place / log)
        if kill is not signal.SIGKILL:
            if scratch:
                found[f"SCRATCH LEFT {scratch[0]}"] += 1
            if list(temporary.iterdir()):
                found[f"TEMPORARY FILES LEFT {sorted(p.name for p in temporary.iterdir())[:2]}"] += 1
        elif scratch or list(temporary.iterdir()):
            run(arguments(place), temporary)
            rest = [path for path in files_of(place) if path not in old]
            if rest or list(temporary.iterdir()):
                found[f"LEFT AFTER THE NEXT RUN {rest[:2]} {sorted(p.name for p in temporary.iterdir())[:2]}"] += 1
        for path in temporary.iterdir():
            shutil.rmtree(path, ignore_errors=True)
            path.unlink(missing_ok=True) if path.is_file() else None
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=10, help="of each command")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--commands", nargs="*", help="only these")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="kill ") as top:
        good = Path(top) / "good"
        good.mkdir()
        at = seeds(good)
        names = list(writers(at, Path(top) / "out.json"))
        total: Counter[str] = Counter()
        for number, name in enumerate(names):
            if options.commands and name not in options.commands:
                continue
            folder = Path(top) / f"case {number}"
            folder.mkdir()
            found = killed(
                name,
                lambda place, name=name: writers(at, place / "out.json")[name],
                folder,
                options.kills,
                np.random.default_rng([options.seed, number]),
            )
            total += found
            print(f"{name:24s} " + ", ".join(f"{key}: {count}" for key, count in found.items()), flush=True)
        print("in all: " + ", ".join(f"{key}: {count}" for key, count in sorted(total.items())))


if __name__ == "__main__":
    main()
