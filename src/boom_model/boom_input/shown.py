"""Makes foreign text safe to show: a file name may hold escape sequences that move the cursor, or a million characters."""

from __future__ import annotations

import os
import shlex
import unicodedata

LONGEST = 200
"""Largest number of characters of foreign text that a message quotes."""

_UNSHOWN = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})


def printable(text: object) -> str:
    r"""The text with control characters written as ``\x1b``; line ends and tabs stay."""
    text = str(text)
    if text.isprintable():  # the usual case, and fast
        return text
    return "".join(c if c in "\n\t" or unicodedata.category(c) not in _UNSHOWN else _escaped(c) for c in text)


def quoted(text: object, longest: int = LONGEST) -> str:
    """The text on one line, printable; of more than `longest` characters the middle is left out."""
    text = str(text)
    if len(text) > 8 * longest:  # enough for both ends, whatever becomes of each character
        text = text[: 4 * longest] + text[-4 * longest :]
    text = printable(" ".join(text.split()))
    if len(text) <= longest:
        return text
    tail = longest // 3
    return f"{text[: longest - tail - 3]}...{text[len(text) - tail :]}"


def typable(*words: str) -> str:
    r"""The words as a shell takes them, on one line; one that cannot be typed as it is becomes ``$'bad\\xff.csv'`` (bash, zsh)."""
    return " ".join(shlex.quote(word) if word.isprintable() and "  " not in word else _spelt(word) for word in words)


def _spelt(word: str) -> str:
    kept = (chr(b) if 32 <= b < 127 and chr(b) not in "\\'" else f"\\x{b:02x}" for b in os.fsencode(word))
    return f"$'{''.join(kept)}'"


def _escaped(character: str) -> str:
    return character.encode("unicode_escape", "surrogatepass").decode("ascii")
