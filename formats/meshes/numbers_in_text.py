"""Numbers in text files, read in one go: the ASCII kinds of scans."""

import re
import warnings

import numpy as np
from numpy.typing import NDArray


def parse(text: bytes, kind: type = np.float64) -> NDArray:
    """Return all numbers of a text (N,), separated by white space.

    Raises ValueError: Something in it is no number.
    """
    if not text.strip():
        return np.zeros(0, kind)
    with warnings.catch_warnings():
        # Older numpy only warns, and stops at the first word that is no number.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, kind, sep=" ")
        except (DeprecationWarning, ValueError):
            word = next((word for word in text.split() if not _is_number(word)), b"?")
            raise ValueError(f"{word[:20].decode('latin-1')!r} is not a number") from None


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


class Lines:
    """A text cut into lines, with access to those that start with a given word.

    text: Lines end with a line feed, with a carriage return, or with both.
    comment: What starts a comment; comments are dropped.
    """

    def __init__(self, text: bytes, comment: bytes = b"#") -> None:
        if b"\n" not in text:
            text = text.replace(b"\r", b"\n")
        if b"\\" in text:
            text = re.sub(rb"\\\r?\n", b" ", text)
        if comment in text:
            text = re.sub(re.escape(comment) + rb"[^\n]*", b"", text)
        if re.search(rb"^[ \t]", text, re.MULTILINE):
            text = re.sub(rb"(?m)^[ \t]+", b"", text)
        self.text = text if text.endswith(b"\n") else text + b"\n"
        self._bytes = np.frombuffer(self.text, np.uint8)
        self._ends = np.flatnonzero(self._bytes == ord("\n")) + 1
        self._starts = np.concatenate([[0], self._ends[:-1]])

    def starting_with(self, word: bytes) -> NDArray[np.bool_]:
        """(L,) whether a line's first word is this one."""
        found = self._ends - self._starts > len(word)
        starts = self._starts[found]
        same = self._bytes[starts + len(word)] <= ord(" ")
        for index, letter in enumerate(word):
            same &= self._bytes[starts + index] == letter
        found[found] = same
        return found

    def select(self, lines: NDArray[np.bool_]) -> bytes:
        """Return the text of the chosen lines (L,)."""
        return self._bytes[np.repeat(lines, self._ends - self._starts)].tobytes()


def words_a_line(text: bytes) -> NDArray[np.int64]:
    """(L,) how many words each line holds, empty lines too."""
    letters = np.frombuffer(text, np.uint8)
    spaces = letters <= ord(" ")
    starts = np.flatnonzero(~spaces & np.concatenate([[True], spaces[:-1]]))
    ends = np.flatnonzero(letters == ord("\n"))
    return np.diff(np.searchsorted(starts, ends), prepend=0)
