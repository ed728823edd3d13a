"""The blind check: logs are made and sealed, all of them diagnosed, and only then are the labels opened."""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from stablepush import __version__
from stablepush.blind.score import Score, score_of
from stablepush.blind.seal import Files, Ledger, complaint, digest, digest_of_folder, open_label, read_files, write_files
from stablepush.blind.supports import cases, imported, score_of_supports
from stablepush.core import InputError, SolverError, run_child, run_parallel, scratch_folder
from stablepush.io import write_atomically, write_json

Progress = Callable[[str, int, int], None]
#: Where entries of the ledger that are of no set stand.
_NO_SET = -1
#: File that a check at work keeps locked.
_LOCK = "lock"
#: What a diagnosis that broke down answers.
FAILED = {"verdict": "failed", "effects": [], "ranking": [], "shrink": [], "where": []}


class BlindCheck:
    """A check in a folder: ``ledger.jsonl``, ``key``, and ``log``, ``label.sealed`` and ``diagnosis.json`` of each set in
    ``sets/NUMBER``.

    The first entry of the ledger says what the check is made of; an interrupted check resumes where it stopped, with the
    same settings. ``generator``: ``"mujoco"``, ``"drake"`` or ``"both"``. ``scheduler``: address of a Dask cluster
    that the work goes to instead of processes of this machine; ``data``: clone of the Manipulation Lab's logs, whose pokes are
    the sets then; ``expect``: hashes of the ledger that were noted.
    """

    def __init__(  # noqa: PLR0913
        self,
        folder: Path,
        generator: str | None = None,
        sets: int | None = None,
        seed: int | None = None,
        pushes: int | None = None,
        jobs: int = 1,
        scheduler: str | None = None,
        data: Path | None = None,
        expect: Sequence[str] = (),
    ) -> None:
        self.folder, self.jobs, self.scheduler, self.data = folder, jobs, scheduler, data
        _made(folder)
        self.ledger = Ledger(folder / "ledger.jsonl")
        self.ledger.expect(expect)
        about = self._about(generator if data is None else "lab", sets, seed, pushes)
        self.generator, self.sets, self.seed, self.pushes = (about[k] for k in ("generator", "sets", "seed", "pushes"))
        self.key = (folder / "key").read_bytes()

    def _about(self, generator: str | None, sets: int | None, seed: int | None, pushes: int | None) -> dict[str, Any]:
        """What the check is made of: as it was begun, else as it is wished."""
        key = self.folder / "key"
        if self.ledger.entries:
            begun = self.ledger.entries[0]
            wished = {"generator": generator, "sets": sets, "seed": seed, "pushes": pushes}
            if begun["event"] != "begun" or not set(wished) <= set(begun):
                raise InputError("line 1", "expected an entry with the settings of the check", file=self.ledger.file)
            for name, value in wished.items():
                if value is not None and value != begun[name]:
                    raise InputError("", f"this check was begun with {name} {begun[name]}, not {value}", file=self.folder)
            if not key.is_file() or digest(key.read_bytes()) != begun["key"]:
                raise InputError("", "expected the key that this check was begun with", file=key)
            if (begun["generator"] == "lab") != (self.data is not None):
                raise InputError("", f"this check was begun with generator {begun['generator']}", file=self.folder)
            return {"generator": str(begun["generator"])} | {name: int(begun[name]) for name in ("sets", "seed", "pushes")}
        from cryptography.fernet import Fernet

        if any(file.name != _LOCK for file in self.folder.iterdir()):
            raise InputError("", "expected an empty folder, or one that holds a check", file=self.folder)
        number = len(cases(self.data)) if self.data is not None else 12
        about = {
            "generator": generator or "mujoco",
            "sets": min(number, sets or number) if self.data is not None else sets or number,
            # seeds that nobody has seen
            "seed": secrets.randbelow(2**31) if seed is None else seed,
            "pushes": pushes or 60,
        }
        with os.fdopen(os.open(key, os.O_WRONLY | os.O_CREAT, 0o600), "wb") as out:
            out.write(Fernet.generate_key())
        self.ledger.add("begun", _NO_SET, key=digest(key.read_bytes()), version=__version__, code=code_of(), **about)
        return about

    def of(self, number: int) -> Path:
        return self.folder / "sets" / f"{number:04d}"

    def seal(self, progress: Progress) -> str:
        """Make the logs that are missing, each in a process of its own, and write their seals into the ledger; return its hash
        after the last of them."""
        missing = [k for k in range(self.sets) if not self.ledger.find("sealed", k)]
        if self.data is None:
            sealed = self._run(generated, [(k, self.generator, self.seed, self.pushes, self.key) for k in missing])
        else:
            sealed = self._run(imported, [(k, self.data, self.key) for k in missing])
        for done, (number, files) in enumerate(sealed, 1):
            write_files(self.of(number), files)
            seal = {"label": digest(files["label.sealed"]), "log": digest_of_folder(self.of(number) / "log")}
            self.ledger.add("sealed", number, **seal)
            progress("sealed", done, len(missing))
        return self._after("sealed")

    def diagnose(self, progress: Progress) -> str:
        """Diagnose what is not diagnosed yet, each log in a process that gets it and nothing else; return the ledger's hash after
        the last of them."""
        missing = [k for k in range(self.sets) if not self.ledger.find("diagnosed", k)]
        for number in missing:
            if digest_of_folder(self.of(number) / "log") != self.ledger.find("sealed", number)[0][1]["log"]:
                raise InputError("", "this is not the log that was sealed", file=self.of(number) / "log")
        jobs = [(k, read_files(self.of(k) / "log")) for k in missing]
        for done, (number, answer) in enumerate(self._run(diagnosed, jobs), 1):
            write_atomically(self.of(number) / "diagnosis.json", answer.decode())
            self.ledger.add("diagnosed", number, diagnosis=digest(answer), code=code_of())
            progress("diagnosed", done, len(missing))
        return self._after("diagnosed")

    def _after(self, event: str) -> str:
        return str(next((e["hash"] for e in reversed(self.ledger.entries) if e["event"] == event), self.ledger.head))

    def score(self, progress: Progress) -> Score:
        """Open the labels of the sets whose seal is whole, and score the answers."""
        rows, refused = [], {}
        for number in range(self.sets):
            folder = self.of(number)
            try:
                sealed, answer = (folder / "label.sealed").read_bytes(), (folder / "diagnosis.json").read_bytes()
            except OSError as error:
                refused[number] = f"{error.filename}: {error.strerror}"
                continue
            words = complaint(self.ledger, number, sealed, folder / "log", answer)
            if words is None:
                label = open_label(self.ledger, number, sealed, self.key)
                rows.append({"set": number, "label": label, "answer": json.loads(answer), "known": {}})
            else:
                refused[number] = words
        codes = {entry["code"] for entry in self.ledger.entries if entry["event"] == "diagnosed"}
        if self.data is not None:
            return score_of_supports(rows, refused, len(codes), self.ledger.head)
        self._know([row for row in rows if row["label"]["kind"] == "effect"], progress)
        return score_of(rows, refused, len(codes), self.seed, self.ledger.head)

    def _know(self, rows: list[dict[str, Any]], progress: Progress) -> None:
        """Add the gap reduction of a fit that knows which effect acts."""
        of_row = {row["set"]: row for row in rows}
        missing = []
        for number, row in of_row.items():
            found, file = self.ledger.find("known", number), self.of(number) / "known.json"
            if found and file.is_file() and digest(file.read_bytes()) == found[-1][1]["closed"]:
                row["known"] = json.loads(file.read_bytes())
            else:
                missing.append(number)
        effects = {k: [a["effect"] for a in of_row[k]["label"]["applied"]] for k in missing}
        jobs = [(k, read_files(self.of(k) / "log"), effects[k]) for k in missing]
        for done, (number, closed) in enumerate(self._run(known, jobs), 1):
            file = self.of(number) / "known.json"
            write_json(file, closed)
            self.ledger.add("known", number, closed=digest(file.read_bytes()))
            of_row[number]["known"] = closed
            progress("fitted with the cause known", done, len(jobs))

    def _run(self, function: Callable[..., Any], jobs: list[tuple[Any, ...]]) -> Iterator[Any]:
        return run_parallel(function, jobs, self.jobs, scheduler=self.scheduler, in_order=False)


def _made(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError("", f"cannot write: {error.strerror}", file=folder) from None


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Keep other checks out of a folder, where the system can."""
    _made(folder)
    try:
        import fcntl
    except ImportError:
        # Windows
        yield
        return
    with (folder / _LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError("", "another check is at work in this folder", file=folder) from None
        yield


def code_of() -> str:
    """Hash of the code that diagnoses, and of what it stands on."""
    root = Path(__file__).parents[1]
    files = sorted(f for f in root.rglob("*.py") if f.parent.name not in ("blind", "cli", "plot"))
    return digest("".join(f"{f.relative_to(root).as_posix()} {digest(f.read_bytes())}\n" for f in files).encode())


def generated(number: int, generator: str, seed: int, pushes: int, key: bytes) -> tuple[int, Files]:
    """Return the files of a set: its generator is a process of its own, that ends before anything is diagnosed."""
    with scratch_folder() as place:
        arguments = [generator, str(seed), str(number), str(pushes), str(place)]
        code, said = run_child("stablepush.blind.generator", arguments, key.decode())
        if code:
            raise SolverError(f"set {number}: its generator failed: {said or code}")
        return number, read_files(place)


def diagnosed(number: int, files: Files) -> tuple[int, bytes]:
    """Return the ``diagnosis/1`` that a process made of the files of a log, in a folder that has nothing else."""
    with scratch_folder() as place:
        write_files(place / "log", files)
        code, said = run_child("stablepush.blind.diagnoser", ["log", "answer.json"], folder=place)
        if code:
            return number, json.dumps({**FAILED, "why": said or str(code)}).encode()
        return number, (place / "answer.json").read_bytes()


def known(number: int, files: Files, effects: list[str]) -> tuple[int, dict[str, float]]:
    """Return the explained fractions by channel of a fit that knows which effects act, for the score."""
    from stablepush.diagnosis import gap_reductions_with
    from stablepush.io import read_pushlog

    with scratch_folder() as place:
        write_files(place, files)
        log = read_pushlog(place)
    return number, {entry.channel: entry.closed for entry in gap_reductions_with(log, effects)}
