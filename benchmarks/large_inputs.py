"""Time and memory of large inputs: reading logs, importing tables, mappings with many keys; each size in a process of its own.

    python benchmarks/large_inputs.py

Beside a log stands Python's own ``csv`` module, which splits the same rows and does nothing else. Memory is the peak of the whole
process (Linux), less that of one that reads the smallest input.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

#: Rows of a push.
ROWS = 100
LOGS, TABLES, KEYS = (10_000, 100_000, 1_000_000), (10_000, 30_000, 100_000), (1_000, 5_000, 20_000)


def write_log(folder: Path, rows: int, parquet: bool = False) -> Path:
    """A log of pushes of a square by one finger."""
    import stablepush as sp
    from stablepush.io import slider_to_json

    folder.mkdir()
    rng = np.random.default_rng(0)
    pushes = rows // ROWS
    rig = {"format": "pushlog/1", "slider": slider_to_json(sp.Slider.rectangle(0.1, 0.1, 1.0)), "gravity": 9.81}
    rig |= {"friction": {"support": 0.3, "contact": 0.5}, "contact_kind": "point", "finger_radius": 0.005}
    (folder / "rig.json").write_text(json.dumps(rig | {"noise": {"force": 0.02, "position": 1e-4, "angle": 1e-3}}))
    (folder / "trials.csv").write_text("trial,start_time\n" + "".join(f"p{k},{10 * k}\n" for k in range(pushes)))
    t = np.tile(np.arange(ROWS) / 100, pushes)
    columns = {
        "x": 0.02 * t, "y": rng.normal(0, 1e-5, rows), "theta": rng.normal(0, 1e-4, rows), "fx": rng.normal(2, 0.02, rows),
        "fy": rng.normal(0, 0.02, rows), "tau": rng.normal(0, 1e-3, rows), "px": 0.02 * t - 0.055, "py": np.zeros(rows),
    }  # fmt: skip
    names = np.repeat([f"p{k}" for k in range(pushes)], ROWS)
    if parquet:
        import pyarrow
        import pyarrow.parquet

        pyarrow.parquet.write_table(pyarrow.table({"trial": names, "t": t, **columns}), folder / "samples.parquet")
        return folder
    with (folder / "samples.csv").open("w") as file:
        file.write(",".join(("trial", "t", *columns)) + "\n")
        for name, row in zip(names, np.column_stack((t, *columns.values())).tolist(), strict=True):
            file.write(f"{name},{','.join(map(repr, row))}\n")
    return folder


def write_table(folder: Path, rows: int) -> Path:
    """A table of the same pushes in one record, and its mapping."""
    log = write_log(folder, rows)
    lines = (log / "samples.csv").read_text().splitlines()
    table = folder / "table.csv"
    with table.open("w") as file:
        file.write(lines[0].replace("trial,t", "push,clock") + "\n")
        for k, line in enumerate(lines[1:]):
            name, _, rest = line.split(",", 2)
            file.write(f"{name},{k / 100 + 5 * (k // ROWS)},{rest}\n")
    names = {
        "trial": "push",
        "t": "clock",
        "x": "x",
        "y": "y",
        "theta": "theta",
        "tip_x": "px",
        "tip_y": "py",
        "fx": "fx",
        "fy": "fy",
    }
    rig = json.loads((log / "rig.json").read_text())
    mapping = {"slider": rig["slider"], "finger_radius": 0.005, "friction": rig["friction"], "columns": names}
    (folder / "mapping.yaml").write_text(json.dumps(mapping))
    return folder


def write_mapping(folder: Path, keys: int) -> Path:
    """A mapping with keys that nobody knows: it is refused."""
    write_table(folder, ROWS)
    (folder / "mapping.yaml").write_text("".join(f"key{k}: {k}\n" for k in range(keys)))
    return folder


def read_log(folder: Path) -> None:
    import stablepush as sp

    sp.read_pushlog(folder)


def read_csv(folder: Path) -> None:
    import csv

    with (folder / "samples.csv").open(newline="") as file:
        list(csv.reader(file))


def import_table(folder: Path) -> None:
    from stablepush.io.importers import find_sources, import_source

    for source in find_sources(folder / "table.csv", mapping=folder / "mapping.yaml"):
        import_source(source)


def refuse_mapping(folder: Path) -> None:
    import stablepush as sp

    try:
        import_table(folder)
    except sp.InputError:
        return
    raise AssertionError("the mapping was taken")


TASKS: dict[str, tuple[Callable[..., Path], Callable[[Path], None], tuple[int, ...]]] = {
    "read_pushlog, CSV": (write_log, read_log, LOGS),
    "Python's csv alone": (write_log, read_csv, LOGS),
    "read_pushlog, Parquet": (lambda folder, rows: write_log(folder, rows, True), read_log, LOGS),
    "import of a CSV table": (write_table, import_table, TABLES),
    "keys of a mapping": (write_mapping, refuse_mapping, KEYS),
}


def peak_memory() -> float:
    """Peak of this process (MB); what getrusage tells includes that of the process which started it."""
    status = Path("/proc/self/status").read_text()
    return float(status.partition("VmHWM:")[2].split()[0]) / 1024


def measured(task: str, folder: Path) -> tuple[float, float]:
    """Time (s) and peak of memory (MB) of a task, in a process of its own."""
    out = subprocess.run([sys.executable, __file__, task, folder], capture_output=True, text=True, check=True).stdout
    seconds, peak = out.split()
    return float(seconds), float(peak)


def main() -> None:
    if len(sys.argv) == 3:
        _, run, _ = TASKS[sys.argv[1]]
        warnings.simplefilter("ignore")
        import stablepush.io.importers  # noqa: F401 (loading is not what grows)

        began = time.perf_counter()
        run(Path(sys.argv[2]))
        print(time.perf_counter() - began, peak_memory())
        return
    print("| what | size | time/s | times as long, for times as much | memory/MB |\n|---|---|---|---|---|")
    with TemporaryDirectory() as top:
        for task, (write, _, sizes) in TASKS.items():
            before: tuple[int, float, float] | None = None
            for size in sizes:
                folder = write(Path(top) / f"{task} {size}", size)
                seconds, peak = measured(task, folder)
                least = before[2] if before else peak
                growth = f"{seconds / before[1]:.1f}, {size / before[0]:.1f}" if before else ""
                print(f"| {task} | {size:,} | {seconds:.2f} | {growth} | {peak - least:.0f} |", flush=True)
                before = (size, seconds, least)


if __name__ == "__main__":
    main()
