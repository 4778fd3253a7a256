"""The door of every reader: foreign errors become one message, and headers are not believed."""

import io
import struct
import zlib

import cv2
import numpy as np
import pytest
import scipy.io
import tifffile

from formats.mat_files import arrays_of_mat
from formats.picture_files import MOST_PIXELS, read_values
from scene.errors import AlignError, CalibrationError, CaptureError, SceneError
from scene.reading import array_of, json_of, numbers, positive, reading, text_of


@pytest.mark.parametrize(
    ("error", "part"),
    [
        (OSError(13, "Permission denied"), "Permission denied"),
        (MemoryError(), "more memory than there is"),
        (RecursionError("maximum"), "nested too deeply"),
        (KeyError("frames"), "KeyError: 'frames'"),
        (struct.error("unpack"), "unpack"),
        (OverflowError(34, "Result too large"), "Result too large"),
        (ValueError("a\nb" + 1000 * "x"), "a bxxx"),
        (ValueError(), "ValueError"),
    ],
)
def test_whatever_a_parser_raises_becomes_the_room_s_error(error, part):
    with pytest.raises(AlignError) as told, reading("scan.ply", "is no mesh", AlignError, do="Export it again."):
        raise error
    assert str(told.value).startswith("scan.ply: ")
    assert part in str(told.value)
    assert str(told.value).endswith("Export it again.")
    assert len(str(told.value)) < 300
    assert "\n" not in str(told.value)
    assert told.value.__cause__ is error


def test_a_json_file_of_any_kind_of_damage(tmp_path):
    path = tmp_path / "a.json"
    for data in (b"", b"{", b"[" * 100_000, b"\xff", b"9" * 10_000, b'{"a": \0}'):
        path.write_bytes(data)
        with pytest.raises(CalibrationError, match=r"a\.json: not JSON"):
            json_of(path, error=CalibrationError)
    with pytest.raises(SceneError, match="No such file"):
        json_of(tmp_path / "gone.json")
    with pytest.raises(SceneError, match="Is a directory"):
        text_of(tmp_path)


def test_a_text_that_nobody_reads_whole(tmp_path):
    with open(tmp_path / "a.lp", "wb") as file:
        file.truncate(10**12)
    with pytest.raises(SceneError, match="MB are the most"):
        text_of(tmp_path / "a.lp")


def npy(shape, kind="<f8", data=bytes(64)):
    head = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".ljust(118).encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + data


@pytest.mark.parametrize(
    "data",
    [
        npy((10**6, 10**6)),
        npy((2**62, 2)),
        npy((-1, 3)),
        npy((8,), "|O"),
        npy((8,), "<U2"),
        npy((8,), "<M8[s]"),
        npy((1,), "<c16"),
        npy("(" * 3000),
        b"PK\x03\x04" + bytes(40),
        b"",
    ],
    ids=["claims 8 TB", "overflows", "negative", "objects", "text", "dates", "complex", "deep", "a zip", "empty"],
)
def test_an_array_that_claims_too_much_or_holds_no_numbers(tmp_path, data):
    (tmp_path / "a.npy").write_bytes(data)
    with pytest.raises(SceneError, match=r"a\.npy: is no array"):
        array_of(tmp_path / "a.npy")


def test_numbers_are_finite_and_of_the_shape_that_is_asked():
    np.testing.assert_array_equal(numbers([[1, 2], [3, 4]], -1, 2), [[1.0, 2.0], [3.0, 4.0]])
    assert positive(2) == 2.0
    for values in ([1, None], [1, np.nan], [1, np.inf], [[1, 2]], [1, 2, 3], [1, [2]], ["a", 1], 10**400):
        with pytest.raises((ValueError, TypeError, OverflowError)):
            numbers(values, 2)
    for value in (0, -1, np.nan, "x"):
        with pytest.raises(ValueError):
            positive(value)


def png(width, height, data=b""):
    """A PNG that claims a size; right in every checksum."""

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")


def tiff(width, height):
    data = io.BytesIO()
    tifffile.imwrite(data, np.zeros((4, 4), np.uint16), metadata=None)
    whole = bytearray(data.getvalue())
    at = struct.unpack_from("<I", whole, 4)[0] + 2
    for tag in range(struct.unpack_from("<H", whole, at - 2)[0]):
        code = struct.unpack_from("<H", whole, at + 12 * tag)[0]
        if code in (256, 257):
            struct.pack_into("<HII", whole, at + 12 * tag + 2, 4, 1, width if code == 256 else height)
    return bytes(whole)


@pytest.mark.parametrize("make", [png, tiff])
def test_a_header_that_claims_more_than_the_file_can_hold(tmp_path, make, monkeypatch):
    """Refused before memory is asked for: the decoder is not even called."""
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("decoded"))
    monkeypatch.setattr("tifffile.TiffPage.asarray", lambda *_: pytest.fail("decoded"))
    for width, height in ((30_000, 30_000), (2**31 - 1, 2**31 - 1), (MOST_PIXELS, 2)):
        (tmp_path / "a.img").write_bytes(make(width, height))
        with pytest.raises(CaptureError, match=r"its header claims \d+ x \d+ px, the file has"):
            read_values(tmp_path / "a.img", CaptureError)


def test_a_byte_that_crashes_the_reader_of_mat_files(tmp_path):
    """scipy.io.loadmat ends by SIGSEGV over it: the reading process dies, this one says so."""
    data = io.BytesIO()
    scipy.io.savemat(data, {"Normal_gt": np.ones((2, 2, 3))})
    good = data.getvalue()
    (tmp_path / "a.mat").write_bytes(good)
    np.testing.assert_array_equal(arrays_of_mat(tmp_path / "a.mat")["Normal_gt"], np.ones((2, 2, 3)))
    for place in (180, 200):
        (tmp_path / "a.mat").write_bytes(good[:place] + b"\x08" + good[place + 1 :])
        with pytest.raises(SceneError, match=r"a\.mat: cannot be read as a MATLAB file"):
            arrays_of_mat(tmp_path / "a.mat")
