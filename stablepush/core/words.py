"""Words of a fixed vocabulary, such as statuses and verdicts: they equal their text and say what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from enum import StrEnum
from typing import Self

from stablepush.core.shown import shown

#: What has more letters is no misspelt word.
_LONGEST = 60
#: So many names stand for a list of them.
_NAMED = 3


class Word(StrEnum):
    """A member is its word, as files have it; ``advice``: what it means for whoever reads it."""

    advice: str

    def __new__(cls, word: str, advice: str = "") -> Self:
        member = str.__new__(cls, word)
        member._value_ = word
        member.advice = advice
        return member


def counted(number: int, what: str) -> str:
    """A number of things: "1 push", "2 pushes"."""
    return f"{number} {what}{('es' if what.endswith('sh') else 's') if number != 1 else ''}"


def some_of(names: Sequence[object]) -> str:
    """The first names of a list, and how many more there are: "p1, p2, p3 and 4 more"."""
    more = len(names) - _NAMED
    return ", ".join(map(shown, names[:_NAMED])) + (f" and {more} more" if more > 0 else "")


def closest(given: str, words: Iterable[str], likeness: float = 0.6) -> str | None:
    """The word that may be meant by one that is in no vocabulary, if any is as like as ``likeness``, 0 to 1."""
    plain = {_plain(word): word for word in words}
    return next((plain[found] for found in difflib.get_close_matches(_plain(given), plain, 1, likeness)), None)


def did_you_mean(given: object, words: Iterable[str]) -> str:
    """What a message adds to a word that is in no vocabulary: the one that may be meant; empty if none is like it."""
    meant = closest(given, words) if isinstance(given, str) and len(given) <= _LONGEST else None
    return f"; did you mean {meant}?" if meant else ""


def _plain(word: str) -> str:
    return word.strip().lower().replace("-", "_").replace(" ", "_")
