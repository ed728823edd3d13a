"""Text from files as it may be shown: on a terminal, in a message, in a picture."""

from __future__ import annotations

import unicodedata

#: Letters of a name that are shown at most; the rest is counted.
_LONGEST = 200
#: Kinds of characters that move a cursor, change colours or the direction of a line, or have no meaning: Unicode's Cc, Cf, Co, Cs
#: and the two separators of lines.
_UNSEEN = ("Cc", "Cf", "Co", "Cs", "Zl", "Zp")


def shown(text: object, most: int = _LONGEST, *, keep: str = "") -> str:
    """Return a text without control characters, which are written as escapes, and not longer than ``most`` characters.

    ``keep``: control characters that stay.
    """
    words = str(text)
    if len(words) > most:
        words = f"{words[: most // 2]}… ({len(words)} characters) …{words[-most // 4 :]}"
    if words.isprintable():
        return words
    return "".join(_escape(c) if c not in keep and unicodedata.category(c) in _UNSEEN else c for c in words)


def _escape(character: str) -> str:
    return character.encode("unicode_escape", "backslashreplace").decode("ascii")
