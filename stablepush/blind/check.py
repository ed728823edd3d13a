"""The blind check: logs are made and sealed, all of them diagnosed, and only then are the labels opened."""

from __future__ import annotations

import json
import os
import secrets
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import joblib

from stablepush.blind.score import Score, score_of
from stablepush.blind.seal import Ledger, complaint, digest, digest_of_folder, open_label
from stablepush.blind.supports import cases, imported, score_of_supports
from stablepush.errors import InputError
from stablepush.files import read_json, write_atomically, write_json

Files = dict[str, bytes]
Said = Callable[[str, int, int], None]


class BlindCheck:
    """A check in a folder: ``check.json`` (what it is made of), ``ledger.jsonl``, ``key`` and ``sets/NUMBER``.

    Every set is a folder with ``log``, ``label.sealed`` and ``diagnosis.json``; a check that was ended goes on where it stopped.
    ``scheduler``: address of a Dask cluster that the work goes to instead of processes of this machine; ``data``: clone of the
    Manipulation Lab's logs, whose pokes are the sets then.
    """

    def __init__(
        self,
        folder: Path,
        sets: int,
        seed: int | None = None,
        pushes: int = 60,
        jobs: int = 1,
        scheduler: str | None = None,
        data: Path | None = None,
    ) -> None:
        self.folder, self.sets, self.jobs, self.scheduler, self.data = folder, sets, jobs, scheduler, data
        generator = "mujoco" if data is None else "lab"
        if data is not None:
            self.sets, seed = min(sets, len(cases(data))), 0
        folder.mkdir(parents=True, exist_ok=True)
        about = folder / "check.json"
        if about.is_file():
            known = read_json(about).value
            if not isinstance(known, dict) or not {"generator", "seed", "pushes"} <= set(known):
                raise InputError(f"{about}: expected the check.json of a blind check")
            for name, wanted in (("generator", generator), ("seed", seed), ("pushes", pushes)):
                if wanted is not None and wanted != known[name]:
                    raise InputError(f"{about}: this check was begun with {name} {known[name]}, not {wanted}")
            self.seed, self.pushes = int(known["seed"]), int(known["pushes"])
        else:
            # seeds that nobody has seen
            self.seed, self.pushes = secrets.randbelow(2**31) if seed is None else seed, pushes
            write_json(about, {"generator": generator, "seed": self.seed, "pushes": self.pushes})
        self.key = self._key()
        self.ledger = Ledger(folder / "ledger.jsonl")

    def _key(self) -> bytes:
        from cryptography.fernet import Fernet

        file = self.folder / "key"
        if not file.is_file():
            write_atomically(file, Fernet.generate_key().decode())
            os.chmod(file, 0o600)
        return file.read_bytes()

    def of(self, number: int) -> Path:
        return self.folder / "sets" / f"{number:04d}"

    def seal(self, said: Said) -> None:
        """Make the logs that are missing, each in a process of its own, and write their seals into the ledger."""
        missing = [k for k in range(self.sets) if not self.ledger.find("sealed", k)]
        if self.data is None:
            jobs = [joblib.delayed(generated)(k, self.seed, self.pushes, self.key) for k in missing]
        else:
            jobs = [joblib.delayed(imported)(k, self.data, self.key) for k in missing]
        for done, (number, files) in enumerate(self._run(jobs), 1):
            _write(self.of(number), files)
            seal = {"label": digest(files["label.sealed"]), "log": digest_of_folder(self.of(number) / "log")}
            self.ledger.add("sealed", number, **seal)
            said("sealed", done, len(missing))

    def diagnose(self, said: Said) -> None:
        """Diagnose what is not diagnosed yet: the process gets the files of the log and nothing else."""
        missing = [k for k in range(self.sets) if not self.ledger.find("diagnosed", k)]
        jobs = [joblib.delayed(diagnosed)(k, _read(self.of(k) / "log")) for k in missing]
        for done, (number, answer) in enumerate(self._run(jobs), 1):
            write_atomically(self.of(number) / "diagnosis.json", answer.decode())
            self.ledger.add("diagnosed", number, diagnosis=digest(answer))
            said("diagnosed", done, len(missing))

    def score(self, said: Said) -> Score:
        """Open the labels of the sets whose seal is whole, and score what was said of them."""
        rows, refused = [], {}
        for number in range(self.sets):
            folder = self.of(number)
            sealed, answer = (folder / "label.sealed").read_bytes(), (folder / "diagnosis.json").read_bytes()
            words = complaint(self.ledger, number, sealed, folder / "log", answer)
            if words is not None:
                refused[number] = words
                continue
            # opened once: a score made again adds nothing to the ledger
            if (folder / "label.json").is_file() and self.ledger.find("opened", number):
                label = dict(read_json(folder / "label.json").value)
            else:
                label = open_label(self.ledger, number, sealed, self.key)
                write_json(folder / "label.json", label)
            rows.append({"set": number, "label": label, "answer": json.loads(answer)})
        if self.data is not None:
            return score_of_supports(rows, refused, self.ledger.head)
        wanted = [row for row in rows if row["label"]["applied"] and not (self.of(row["set"]) / "known.json").is_file()]
        jobs = [
            joblib.delayed(known)(row["set"], _read(self.of(row["set"]) / "log"), [a["effect"] for a in row["label"]["applied"]])
            for row in wanted
        ]
        for done, (number, closed) in enumerate(self._run(jobs), 1):
            write_json(self.of(number) / "known.json", closed)
            said("fitted with the cause known", done, len(jobs))
        for row in rows:
            file = self.of(row["set"]) / "known.json"
            row["known"] = read_json(file).value if file.is_file() else {}
        return score_of(rows, refused, self.seed, self.ledger.head)

    def _run(self, jobs: list[Any]) -> Iterator[Any]:
        with self._engine():
            yield from joblib.Parallel(n_jobs=self.jobs, return_as="generator_unordered")(jobs)

    @contextmanager
    def _engine(self) -> Iterator[None]:
        """Processes of this machine, or a Dask cluster."""
        if self.scheduler is None:
            yield
            return
        try:
            from dask.distributed import Client
        except ImportError:
            raise InputError('a Dask cluster needs the extra "scale": pip install "stablepush[scale]"') from None
        try:
            client = Client(self.scheduler, timeout="10s")
        except (OSError, ValueError) as error:
            raise InputError(f"--scheduler: no Dask cluster answers at {self.scheduler!r}: {error}") from None
        with client, joblib.parallel_config(backend="dask"):
            yield


def generated(number: int, seed: int, pushes: int, key: bytes) -> tuple[int, Files]:
    """Return the files of a set: its generator is a process of its own, that ends before anything is diagnosed."""
    with tempfile.TemporaryDirectory() as place:
        command = [sys.executable, "-m", "stablepush.blind.generator", str(seed), str(number), str(pushes), place]
        done = subprocess.run(command, input=key.decode() + "\n", text=True, capture_output=True, check=False)
        if done.returncode:
            last = done.stderr.strip().splitlines()
            raise RuntimeError(f"set {number}: its generator failed: {last[-1] if last else done.returncode}")
        return number, _read(Path(place))


def diagnosed(number: int, files: Files) -> tuple[int, bytes]:
    """Return a ``diagnosis/1`` with the time that it took; ``files``: of the log."""
    from stablepush.diagnosis import diagnose
    from stablepush.logs import read_pushlog

    with tempfile.TemporaryDirectory() as place:
        _write(Path(place), files)
        log = read_pushlog(Path(place))
    begin = time.perf_counter()
    answer = diagnose(log, name=f"{number:04d}").to_json()
    return number, json.dumps({**answer, "seconds": round(time.perf_counter() - begin, 2)}, indent=1).encode()


def known(number: int, files: Files, effects: list[str]) -> tuple[int, dict[str, float]]:
    """Return the closed shares by channel of a fit that knows which effects act, for the score."""
    from stablepush.diagnosis.gap_report import shrink_with
    from stablepush.logs import read_pushlog

    with tempfile.TemporaryDirectory() as place:
        _write(Path(place), files)
        log = read_pushlog(Path(place))
    return number, {entry["channel"]: entry["closed"] for entry in shrink_with(log, effects)}


def _read(folder: Path) -> Files:
    return {f.relative_to(folder).as_posix(): f.read_bytes() for f in sorted(folder.rglob("*")) if f.is_file()}


def _write(folder: Path, files: Files) -> None:
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
