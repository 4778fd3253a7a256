"""The door of every reader: what a parser stumbles over in a foreign or damaged file ends as one message."""

import codecs
import contextlib
import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError

MOST_FAULTS = 100
"""That are told at once."""
LONGEST_TEXT = 64 << 20
"""Bytes. Tables, JSON and lists of this project's kinds are a thousand times smaller."""
ENCODE = "Save the file as UTF-8: most editors offer it where they save, as encoding."


@contextlib.contextmanager
def reading(
    path: Path | str,
    fault: str = "cannot be read",
    error: type[SceneError] = SceneError,
    *,
    do: str = "Restore the file, or write it anew.",
) -> Iterator[None]:
    """Turn whatever the block raises over a file into an error that names the file.

    Parameters
    ----------
    path : Path or str
        What is read.
    fault : str
        What is then wrong with it: "cannot be read as a mesh".
    error : type of SceneError
        What to raise.
    do : str
        One sentence: what the user can do.

    Raises
    ------
    SceneError
        Of the type `error`. Errors of that family, and missing modules, pass as they are.
    """
    try:
        yield
    except (SceneError, ImportError):
        raise
    except OSError as found:
        raise error(f"{path}: cannot be read ({reason(found)}). {do}") from found
    except Exception as found:
        # Parsers raise many kinds of errors over damaged bytes; to the user they all mean the same.
        raise error(f"{path}: {fault} ({reason(found)}). {do}") from found


def reason(error: BaseException) -> str:
    """Return in one short line what a foreign error says."""
    if isinstance(error, MemoryError):
        return "it asks for more memory than there is"
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    said = error.args[0] if error.args else ""
    text = said.decode(errors="replace") if isinstance(said, bytes) else str(error)
    name = type(error).__name__
    return shortened(f"{name}: {text}" if isinstance(error, LookupError) or not text else text)


def shortened(text: str, longest: int = 200) -> str:
    """Return a text in one line of printable characters, cut where it is long."""
    line = " ".join("".join(letter if letter.isprintable() else " " for letter in text[: 2 * longest]).split())
    return line if len(line) <= longest else f"{line[:longest]} ..."


def listed(words: Iterable[object], most: int = 5) -> str:
    """Return the first words with commas, and how many more there are."""
    texts = [str(word) for word in words]
    return ", ".join(texts[:most]) + (f" and {len(texts) - most} more" if len(texts) > most else "")


def told(where: object, faults: Sequence[str]) -> str:
    """Return all faults of a file or folder as one message."""
    lines = [shortened(fault, 600) for fault in faults[:MOST_FAULTS]]
    if len(faults) == 1:
        return f"{where}: {lines[0]}"
    more = [f"and {len(faults) - MOST_FAULTS} more"] if len(faults) > MOST_FAULTS else []
    return "\n  ".join([f"{where}: {len(faults)} faults.", *lines, *more])


def text_of(
    path: Path,
    fault: str = "cannot be read as text",
    error: type[SceneError] = SceneError,
    *,
    most: int = LONGEST_TEXT,
    names: bool = False,
    **how: Any,
) -> str:
    r"""Return a text in UTF-8, or in the encoding that its mark tells, without the mark, lines ended by \n.

    See `reading` for the other parameters.

    Parameters
    ----------
    most : int
        Bytes that such a file may have.
    names : bool
        What is not ASCII in it are files' names, which are only compared: bytes that are not UTF-8 are kept as lone
        surrogates, as Python keeps those of paths.
    """
    with reading(path, fault, error, **how):
        size = path.stat().st_size
        if size > most:
            raise ValueError(f"{size / 2**20:.1f} MB; {most >> 20} MB are the most")
        data = path.read_bytes()
        try:
            if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
                text = data.decode("utf-16")
            else:
                text = data.decode("utf-8-sig", "surrogateescape" if names else "strict")
        except UnicodeDecodeError as found:
            number = data.count(b"\n", 0, found.start)
            line = shortened(data.split(b"\n")[number].decode("latin-1"), 80)
            told = f"line {number + 1} is not {found.encoding.upper()}: {line} (read as Latin-1). {ENCODE}"
            raise error(f"{path}: {fault}: {told}") from found
        if "\0" in text:
            raise error(f"{path}: {fault}: it holds zero bytes, as a text in UTF-16 without its mark does. {ENCODE}")
        return text.replace("\r\n", "\n").replace("\r", "\n")


def json_of(path: Path, fault: str = "not JSON", error: type[SceneError] = SceneError, **how: Any) -> Any:
    """Return what a JSON file holds; see `reading` for the parameters."""
    text = text_of(path, fault, error, **how)
    with reading(path, fault, error, **how):
        return json.loads(text)


def array_of(path: Path, fault: str = "is no array", error: type[SceneError] = SceneError, **how: Any) -> NDArray:
    """Return the numbers of a .npy file as a memory map: its header cannot claim more than the file holds.

    See `reading` for the parameters.
    """
    with reading(path, fault, error, **how):
        array = np.lib.format.open_memmap(path, mode="r")
        if array.dtype.kind not in "biuf":
            raise ValueError(f"it holds {array.dtype}, not numbers")
        return array


def numbers(values: Any, *shape: int, what: str = "") -> NDArray[np.float64]:
    """Return finite numbers as an array of a given shape; -1 stands for any length.

    Raises
    ------
    ValueError
        Another shape, or something that is no finite number.
    """
    array = np.array(values, np.float64)
    if array.ndim != len(shape) or any(want not in (-1, size) for want, size in zip(shape, array.shape, strict=True)):
        wanted = " x ".join("n" if size < 0 else str(size) for size in shape)
        raise ValueError(f"{what or 'numbers'}: found the shape {array.shape}, expected {wanted or 'one number'}")
    if not np.isfinite(array).all():
        raise ValueError(f"{what or 'numbers'}: not all of them are finite")
    return array


def positive(value: Any) -> float:
    """Return a finite number above 0; ValueError for anything else."""
    number = float(numbers(value))
    if number <= 0:
        raise ValueError(f"{number:g} is not above 0")
    return number
