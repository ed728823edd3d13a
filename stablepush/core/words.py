"""Words of a fixed vocabulary, such as statuses and verdicts: they equal their text and say what to do."""

from __future__ import annotations

from enum import StrEnum
from typing import Self


class Word(StrEnum):
    """A member is its word, as files have it; ``advice``: what it means for whoever reads it."""

    advice: str

    def __new__(cls, word: str, advice: str = "") -> Self:
        member = str.__new__(cls, word)
        member._value_ = word
        member.advice = advice
        return member
