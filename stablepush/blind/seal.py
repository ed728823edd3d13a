"""Labels under seal: encrypted before any diagnosis runs, and a ledger that shows in which order everything happened.

Each entry of the ledger names what was sealed, diagnosed or opened by its SHA-256, and holds the hash of the entry before: none
can be changed, left out or inserted without every later hash being wrong. A label counts only if it was sealed before its
log was diagnosed, and opened after. Who has the folder can rewrite all of the ledger, or cut its end off: that is noticed by
whoever noted the last hash when all was sealed, and when all was diagnosed (both are printed), and asks for it again.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from stablepush.core import InputError

Files = dict[str, bytes]
_FIRST = "0" * 64


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def digest_of_folder(folder: Path) -> str:
    """Hash of all files of a folder with their names."""
    total = hashlib.sha256()
    for file in sorted(f for f in folder.rglob("*") if f.is_file()):
        total.update(f"{file.relative_to(folder).as_posix()}\n{digest(file.read_bytes())}\n".encode())
    return total.hexdigest()


class Ledger:
    """A chain of entries in a file, one JSON object a line; reading it checks the chain."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.entries: list[dict[str, Any]] = []
        self._whole = 0
        if not file.is_file():
            return
        try:
            lines = file.read_bytes().decode("utf-8").split("\n")
        except UnicodeDecodeError:
            raise InputError("", "expected the ledger of a blind check, this is no text", file=file) from None
        for number, line in enumerate(lines, 1):
            if not line and number == len(lines):
                break
            # an entry that was being written when the process was ended counts for nothing; the next one takes its place
            if number == len(lines) and self.entries and not _whole(line):
                break
            self.entries.append(self._checked(line, number))
            self._whole += len(line.encode()) + 1

    def _checked(self, line: str, number: int) -> dict[str, Any]:
        try:
            entry = dict(json.loads(line))
            own = entry.pop("hash")
        except (ValueError, KeyError, TypeError):
            raise InputError(f"line {number}", "expected an entry of the ledger of a blind check", file=self.file) from None
        if entry.get("before") != self.head or _hash(entry) != own:
            raise InputError(f"line {number}", "the chain is broken: the ledger was changed after it was written", file=self.file)
        return {**entry, "hash": own}

    @property
    def head(self) -> str:
        """Hash of the last entry. Whoever has it can tell whether anything before was changed."""
        return str(self.entries[-1]["hash"]) if self.entries else _FIRST

    def expect(self, heads: Sequence[str]) -> None:
        """Refuse a ledger that lacks one of the hashes that were noted before."""
        if heads and not self.entries:
            raise InputError(
                "--expect", "expected the hash of a check that was begun; this folder holds none", file=self.file.parent
            )
        for head in heads:
            if all(entry["hash"] != head for entry in self.entries):
                raise InputError(
                    "", f"the hash {head} is not in it: the ledger was rewritten, or its end was cut off", file=self.file
                )

    def add(self, event: str, number: int, **what: Any) -> None:
        entry: dict[str, Any] = {"event": event, "set": number, **what, "before": self.head}
        entry["hash"] = _hash(entry)
        line = (json.dumps(entry) + "\n").encode()
        with self.file.open("r+b" if self.file.is_file() else "wb") as out:
            out.truncate(self._whole)
            out.seek(self._whole)
            if self._whole and self.entries:
                # the last line may have lost its end
                out.seek(self._whole - 1)
                out.write(b"\n")
            out.write(line)
            out.flush()
            os.fsync(out.fileno())
        self._whole += len(line)
        self.entries.append(entry)

    def find(self, event: str, number: int) -> list[tuple[int, dict[str, Any]]]:
        """Entries of an event and set, with their places."""
        return [(i, e) for i, e in enumerate(self.entries) if e["event"] == event and e["set"] == number]


def _whole(line: str) -> bool:
    try:
        return "hash" in json.loads(line)
    except (ValueError, TypeError):
        return False


def _hash(entry: dict[str, Any]) -> str:
    return digest(json.dumps({k: v for k, v in entry.items() if k != "hash"}, sort_keys=True).encode())


def open_label(ledger: Ledger, number: int, sealed: bytes, key: bytes) -> dict[str, Any]:
    """Return a label; that it is opened for the first time is written down."""
    from cryptography.fernet import Fernet, InvalidToken

    try:
        label = dict(json.loads(Fernet(key).decrypt(sealed)))
    except (InvalidToken, ValueError):
        raise InputError(
            f"set {number}", "the sealed label does not open with the key of this check: one of them was changed"
        ) from None
    if not ledger.find("opened", number):
        ledger.add("opened", number, label=digest(sealed))
    return label


def complaint(ledger: Ledger, number: int, sealed: bytes, log: Path, diagnosis: bytes) -> str | None:
    """Return why a set does not count, in words; None if its seal is whole.

    ``sealed``, ``log`` and ``diagnosis`` are what is there now.
    """
    first_seals, diagnosed, opened = (ledger.find(event, number) for event in ("sealed", "diagnosed", "opened"))
    if len(first_seals) != 1:
        return "not sealed, or sealed more than once"
    at, seal = first_seals[0]
    if seal["label"] != digest(sealed):
        return "the sealed label is not the one that was sealed"
    if seal["log"] != digest_of_folder(log):
        return "the log is not the one that was sealed with the label"
    if len(diagnosed) != 1 or diagnosed[0][0] < at:
        return "not diagnosed once, after the label was sealed"
    if diagnosed[0][1]["diagnosis"] != digest(diagnosis):
        return "the diagnosis is not the one that was made before the label was opened"
    if any(place < diagnosed[0][0] for place, _ in opened):
        return "the label was opened before the diagnosis was made"
    return None


def read_files(folder: Path) -> Files:
    """Return the files of a folder."""
    return {f.relative_to(folder).as_posix(): f.read_bytes() for f in sorted(folder.rglob("*")) if f.is_file()}


def write_files(folder: Path, files: Files) -> None:
    """Write files into a folder."""
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
