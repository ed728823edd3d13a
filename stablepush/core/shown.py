"""Text from files as it may be shown: on a terminal, in a message, in a picture."""

from __future__ import annotations

import unicodedata

#: Letters of a name that are shown at most; the rest is counted.
_LONGEST = 200


def shown(text: object, most: int = _LONGEST, *, keep: str = "") -> str:
    """Return a text without what moves a cursor, changes colours or the direction of a line, or cannot be seen.

    Such characters are written as escapes. Of more than ``most`` characters the middle is left out. ``keep``: those that stay.
    """
    words = str(text)
    if len(words) > most:
        words = f"{words[: most // 2]}… ({len(words)} characters) …{words[-most // 4 :]}"
    if words.isprintable():
        return words
    return "".join(c if c.isprintable() or c in keep or unicodedata.category(c) == "Zs" else _escape(c) for c in words)


def _escape(character: str) -> str:
    return character.encode("unicode_escape", "backslashreplace").decode("ascii")
