"""The tags that a camera wrote into a photograph, by EXIF's names, whatever the file: TIFF is read by tifffile.

Most RAW files are TIFF. Others hold blocks of TIFF: JPEG, .raf and .x3f behind "Exif", .cr3 in the boxes CMT1 and CMT2,
.mrw in TTW, PNG in the chunk eXIf or in hexadecimal digits as a text. .crw and the older .x3f have words of their own.
"""

import io
import logging
import re
import struct
import time
import zlib
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

# What it would print of damaged blocks is no news: they hold no tags.
logging.getLogger("tifffile").addHandler(logging.NullHandler())

HEAD = 1 << 20
"""Bytes at a file's beginning and at its end in which its blocks begin."""
MOST = 500
"""Of blocks, directories, entries: a damaged file can promise any number."""
TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
BLOCK = re.compile(rb"(?:Exif\0\0|CMT[12]|\0TTW....|eXIf)(?=II\*\0|MM\0\*)", re.DOTALL)
PROFILE = re.compile(rb"([zt])(?:TXt|EXt)Raw profile type (?:exif|APP1)\0")
DIGITS = re.compile(rb"\s*\w+\s+(\d+)\s+([0-9a-fA-F\s]+)")
"""Of a profile as a text: its kind, its length, its bytes."""
PANASONIC_ISO = {"55": "ISOSpeedRatings", "23": "ISOSpeedRatings"}
"""Tags 0x37 and 0x17 of .rw2, which have no name elsewhere."""
X3F = {
    "SHUTTER": "ExposureTime", "APERTURE": "FNumber", "ISO": "ISOSpeedRatings", "FLENGTH": "FocalLength",
    "FLEQ35MM": "FocalLengthIn35mmFilm", "CAMMANUF": "Make", "CAMMODEL": "Model",
}  # fmt: skip


def tags_in(path: Path) -> dict[str, Any]:
    """Return {EXIF's name: value} of a photograph: a number, a text, (numerator, denominator), or a tuple of numbers.

    Raises
    ------
    Exception
        Of any kind: there is no such file, or it is damaged.
    """
    with open(path, "rb") as file:
        data = file.read(HEAD)
        if data[6:14] == b"HEAPCCDR":
            return _tags_of_crw(data + file.read())
        is_x3f = data.startswith(b"FOVb")
        blocks: list[BinaryIO] = [file] if data[:2] in (b"II", b"MM") else []
        if data[:4] not in TIFF:
            file.seek(HEAD if is_x3f else max(HEAD, path.stat().st_size - HEAD))
            data += file.read()
            blocks += map(io.BytesIO, islice(_blocks(data), MOST))
        found = _tags_of_x3f(data) if is_x3f else {}
        for block in reversed(blocks):
            block.seek(0)
            found |= _tags_of_tiff(block)
        return found


def _blocks(data: bytes) -> Iterator[bytes]:
    for at in BLOCK.finditer(data):
        yield data[at.end() :][:HEAD]
    for at in PROFILE.finditer(data):
        text = data[at.end() :][:HEAD]
        written = DIGITS.match(zlib.decompressobj().decompress(text[1:], HEAD) if at[1] == b"z" else text)
        digits = b"".join(written[2].split())[: 2 * int(written[1])] if written else b""
        yield from _blocks(b"Exif\0\0" + bytes.fromhex(digits.decode()))


def _tags_of_tiff(block: BinaryIO) -> dict[str, Any]:
    import tifffile

    try:
        with tifffile.TiffFile(block) as file:
            tags = file.pages.first.tags
            plain = {PANASONIC_ISO.get(tag.name, tag.name): tag.value for tag in tags if tag.count < MOST}
            exif = tags.valueof("ExifTag", {})
            return plain | dict(exif if isinstance(exif, Mapping) else {})
    except Exception:
        # A maker's malformed block breaks parsers in many ways; the others still count.
        return {}


def _tags_of_crw(data: bytes) -> dict[str, Any]:
    """Return the tags of Canon's heap of records: its last four bytes tell where the directory is, and heaps nest."""
    order = "<" if data[:2] == b"II" else ">"
    records: dict[int, bytes] = {}
    heaps = [(struct.unpack_from(f"{order}I", data, 2)[0], len(data))]
    for start, end in heaps:
        at = start + struct.unpack_from(f"{order}I", data, end - 4)[0]
        (count,) = struct.unpack_from(f"{order}H", data, at)
        for kind, size, offset in struct.iter_unpack(f"{order}HII", data[at + 2 : at + 2 + 10 * min(count, MOST)]):
            at += 10
            if kind & 0x4000:
                records[kind & 0x3FFF] = data[at - 6 : at + 2]
            elif kind & 0x3800 in (0x2800, 0x3000) and len(heaps) < MOST:
                heaps.append((start + offset, start + offset + size))
            else:
                records[kind] = data[start + offset : start + offset + size]

    def values(kind: int, form: str) -> NDArray:
        found = records.get(kind, b"")
        return np.frombuffer(found[: len(found) // int(form[1]) * int(form[1])], order + form)

    # Logarithms to the base 2, as EXIF's APEX values: as they were, as they were written, as they were wanted.
    shot, written = np.pad(values(0x102A, "i2"), (0, 32)), np.pad(values(0x1818, "f4"), (0, 3))
    shutter, aperture = _stops(shot[22] or shot[5]), _stops(shot[21] or shot[4])
    shutter, aperture = shutter or written[1], aperture or written[2]
    focal, camera = np.pad(values(0x1029, "u2"), (0, 2)), [*records.get(0x080A, b"").split(b"\0"), b""]
    unit = np.pad(values(0x102D, "u2"), (0, 26))[25]
    return {
        "ExposureTime": 2.0**-shutter if shutter or 0x1818 in records else 0,
        "FNumber": 2.0 ** (aperture / 2) if aperture else 0,
        "ISOSpeedRatings": 3.125 * 2.0 ** ((shot[1] + shot[2]) / 32) if shot[2] else 0,
        "FocalLength": focal[1] / max(unit, 1),
        **{name: word.decode("latin-1") for name, word in zip(("Make", "Model"), camera, strict=False)},
        "DateTimeOriginal": next(map(_stamp, values(0x180E, "u4")), ""),
    }


def _stops(written: int) -> float:
    """Return what Canon writes in 32nds of a stop, a third of one as 12 of them."""
    return written // 32 + {12: 1 / 3, 20: 2 / 3}.get(int(written % 32), written % 32 / 32)


def _tags_of_x3f(data: bytes) -> dict[str, Any]:
    """Return the tags of Sigma's section of properties: pairs of places, counted in letters, then the UTF-16 texts."""
    at = data.find(b"SECp")
    if at < 0:
        return {}
    (count,) = struct.unpack_from("<I", data, at + 8)
    text = data[at + 24 + 8 * count :][:HEAD].decode("utf-16-le", "replace")
    places = struct.iter_unpack("<2I", data[at + 24 : at + 24 + 8 * min(count, MOST)])
    words = dict([text[place : place + 99].partition("\0")[0] for place in pair] for pair in places)
    found: dict[str, Any] = {name: words[word] for word, name in X3F.items() if words.get(word)}
    found.setdefault("ExposureTime", (words.get("EXPTIME"), 1_000_000))
    return found | {"DateTimeOriginal": _stamp(words.get("TIME", ""))}


def _stamp(seconds: Any) -> str:
    """Return a time as EXIF has it, of seconds from 1970 on that a clock without a zone counts; empty for others."""
    return time.strftime("%Y:%m:%d %H:%M:%S", time.gmtime(int(seconds))) if str(seconds).isdecimal() else ""
