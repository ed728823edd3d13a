"""Labels under seal: encrypted before any diagnosis runs, and a ledger that shows in which order everything happened.

Each entry of the ledger names what was sealed, diagnosed or opened by its SHA-256, and holds the hash of the entry before: none
can be changed, left out or put in between without every later hash being wrong. A label counts only if it was sealed before its
log was diagnosed, and opened after.
"""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from stablepush.errors import InputError

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
        if file.is_file():
            text = file.read_text(encoding="utf-8")
            # a line that was being written when the process was ended counts for nothing
            lines = text.split("\n")
            if lines[-1]:
                file.write_text("".join(line + "\n" for line in lines[:-1]), encoding="utf-8")
            for number, line in enumerate(lines[:-1], 1):
                self.entries.append(self._checked(line, number))

    def _checked(self, line: str, number: int) -> dict[str, Any]:
        try:
            entry = json.loads(line)
            own = entry.pop("hash")
        except (ValueError, KeyError, AttributeError):
            raise InputError(f"{self.file}, line {number}: expected an entry of a ledger") from None
        before = self.entries[-1]["hash"] if self.entries else _FIRST
        if entry.get("before") != before or _hash(entry) != own:
            raise InputError(f"{self.file}, line {number}: the chain is broken: the ledger was changed after it was written")
        return {**entry, "hash": own}

    @property
    def head(self) -> str:
        """Hash of the last entry: whoever has it can tell whether anything before was changed."""
        return str(self.entries[-1]["hash"]) if self.entries else _FIRST

    def add(self, event: str, number: int, **what: str) -> None:
        entry: dict[str, Any] = {"event": event, "set": number, **what, "before": self.head}
        entry["hash"] = _hash(entry)
        with self.file.open("a", encoding="utf-8") as out:
            out.write(json.dumps(entry) + "\n")
            out.flush()
            os.fsync(out.fileno())
        self.entries.append(entry)

    def find(self, event: str, number: int) -> list[tuple[int, dict[str, Any]]]:
        """Entries of an event and set, with their places."""
        return [(i, e) for i, e in enumerate(self.entries) if e["event"] == event and e["set"] == number]


def _hash(entry: dict[str, Any]) -> str:
    return digest(json.dumps({k: v for k, v in entry.items() if k != "hash"}, sort_keys=True).encode())


def open_label(ledger: Ledger, number: int, sealed: bytes, key: bytes) -> dict[str, Any]:
    """Return a label; that it was opened is written down first."""
    from cryptography.fernet import Fernet, InvalidToken

    ledger.add("opened", number, label=digest(sealed))
    try:
        return dict(json.loads(Fernet(key).decrypt(sealed)))
    except (InvalidToken, ValueError):
        raise InputError(f"set {number}: the sealed label was changed: it does not open with the key of this check") from None


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
