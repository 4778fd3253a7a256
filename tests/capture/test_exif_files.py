"""Where each kind of file keeps its settings: blocks by Pillow in files of every kind, without a picture."""

import struct
import zlib

import numpy as np
import pytest
from PIL.TiffImagePlugin import IFDRational, ImageFileDirectory_v2

from capture.camera.exif import Exif, read_exif

SHOT = Exif(1 / 125, 200.0, 5.6, 50.0, 75.0, (2540 / 25.4, 5080 / 25.4), 60, 1350.0, "Maker Model 1")


FIRST = {271: "Maker", 272: "Model 1", 274: 6}
SETTINGS = {
    33434: 1 / 125, 33437: 5.6, 34855: 200, 37386: 50.0, 41989: 75, 36867: "2026:11:21 09:30:12", 37382: 1.35,
    40962: 60, 41486: 2540.0, 41487: 5080.0, 41488: 2,
}  # fmt: skip


def tiff(order="<", first=FIRST, exif=SETTINGS, magic=None):
    """Return a TIFF of one directory, and the one of EXIF in it."""
    head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(f"{order}I", 8)
    found = ImageFileDirectory_v2(head)
    found.update(first | ({34665: exif} if exif else {}))
    return (magic or head[:4]) + head[4:] + found.tobytes(8)


def jpeg(block):
    app1 = b"Exif\0\0" + block
    return b"\xff\xd8\xff\xe1" + struct.pack(">H", len(app1) + 2) + app1 + b"\xff\xd9"


def box(kind, body):
    return struct.pack(">I4s", 8 + len(body), kind) + body


def cr3(order):
    canon = bytes.fromhex("85c0b687820f11e08111f4ce462b6a48")
    blocks = box(b"CMT1", tiff(order, exif={})) + box(b"CMT2", tiff(order, SETTINGS, {}))
    return box(b"ftyp", b"crx \0\0\0\1crx isom") + box(b"moov", box(b"uuid", canon + blocks)) + box(b"mdat", bytes(64))


def raf(order):
    head = b"FUJIFILMCCD-RAW 0201FF123456Model 1".ljust(84, b"\0") + struct.pack(">II", 160, 5000)
    return head.ljust(160, b"\0") + jpeg(tiff(order))


def mrw(order):
    ttw = b"\0TTW" + struct.pack(">I", len(tiff(order))) + tiff(order)
    prd = b"\0PRD" + struct.pack(">I", 24) + bytes(24)
    return b"\0MRM" + struct.pack(">I", len(prd + ttw)) + prd + ttw


def rw2(order):
    """ISO in a tag of its own, the rest in EXIF; what is only in the JPEG is the equivalent focal length."""
    exif = {tag: value for tag, value in SETTINGS.items() if tag not in (34855, 41989)}
    return tiff(order, FIRST | {23: 200}, exif, b"IIU\0") + jpeg(tiff(order, exif={33434: 1 / 60, 41989: 75}))


def chunk(kind, body):
    return struct.pack(">I4s", len(body), kind) + body + struct.pack(">I", zlib.crc32(kind + body))


def png(*chunks, picture=True):
    start = chunk(b"IHDR", struct.pack(">2I5B", 1, 1, 8, 0, 0, 0, 0))
    pixels = [chunk(b"IDAT", zlib.compress(bytes(2)))] * picture
    return b"\x89PNG\r\n\x1a\n" + start + b"".join([*pixels, *chunks]) + chunk(b"IEND", b"")


FILES = {
    "a.jpg": lambda order: jpeg(tiff(order)),
    "a.tif": tiff,
    "a.nef": tiff,
    "a.orf": lambda order: tiff(order, magic=b"IIRO" if order == "<" else b"MMOR"),
    "a.cr3": cr3,
    "a.raf": raf,
    "a.mrw": mrw,
    "a.rw2": rw2,
    "eXIf behind the picture.png": lambda order: png(chunk(b"eXIf", tiff(order))),
    "eXIf as in a JPEG.png": lambda order: png(chunk(b"eXIf", b"Exif\0\0" + tiff(order)), picture=False),
}


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("name", FILES)
def test_every_kind_of_file_tells_its_settings(tmp_path, name, order):
    if name == "a.rw2" and order == ">":
        pytest.skip("there are none")
    (tmp_path / name).write_bytes(FILES[name](order))
    assert read_exif(tmp_path / name) == SHOT


def test_a_damaged_block_does_not_hide_the_other(tmp_path):
    data = cr3("<")
    at = data.index(b"CMT1II*\0") + 8
    (tmp_path / "a.cr3").write_bytes(data[:at] + b"\xff\xff\xff\x7f" + data[at + 4 :])
    found = read_exif(tmp_path / "a.cr3")
    assert (found.exposure_s, found.iso, found.camera) == (1 / 125, 200, None)


@pytest.mark.parametrize("tag", [34866, 34865, 34867])
def test_a_sensitivity_of_more_than_16_bits(tmp_path, tag):
    """65535 stands for "more": taken as it is, 102400 and 204800 would be one exposure."""
    more = SETTINGS | {34855: 65535}
    (tmp_path / "a.tif").write_bytes(tiff(exif=more | {tag: 204800}))
    assert read_exif(tmp_path / "a.tif").iso == 204800
    (tmp_path / "a.tif").write_bytes(tiff(exif=more))
    assert read_exif(tmp_path / "a.tif").iso is None
    del more[34855]
    (tmp_path / "a.rw2").write_bytes(tiff("<", FIRST | {23: 65535, 55: 204800}, more, b"IIU\0"))
    assert read_exif(tmp_path / "a.rw2").iso == 204800


@pytest.mark.parametrize(
    "exif",
    [
        {33434: 0.0, 33437: IFDRational(0, 0), 37386: 0.0, 37382: float(0xFFFFFFFF)},
        "P5\n1 1\n255\nx",
        "\xff\xd8\xff\xe1\x00\x10Exif\0\0II*\0\xff\xff",
        None,
    ],
    ids=["zeros, and focused at infinity", "PGM", "torn", "absent"],
)
def test_what_is_not_there_is_nothing(tmp_path, exif, capsys):
    """A camera that does not know its lens writes 0 mm at f/0."""
    if isinstance(exif, str):
        (tmp_path / "a.jpg").write_bytes(exif.encode("latin-1"))
    elif exif:
        (tmp_path / "a.jpg").write_bytes(jpeg(tiff(first={}, exif=exif)))
    assert read_exif(tmp_path / "a.jpg") == Exif()
    assert capsys.readouterr() == ("", "")


def test_a_real_raw_file_without_exposure(shared):
    found = read_exif(shared("real/raw_dng/colorchart.dng"))
    assert found.camera == "Canon Canon EOS Kiss X4"
    assert (found.exposure_s, found.iso, found.aperture) == (None, None, None)


def test_damaged_files_say_what_is_left_and_nothing_else(tmp_path, capfd):
    """Bits turned, bytes cut, counts without end: None, in the time of reading."""
    rng = np.random.default_rng(0)
    for name, write in FILES.items():
        whole = write("<")
        for _ in range(25):
            data = bytearray(whole[: rng.integers(len(whole) // 3, len(whole) + 1)])
            places = rng.integers(0, len(data), rng.integers(1, 12))
            start = max(0, len(data) - 2000)
            for place in places if rng.random() < 0.5 else start + places % (len(data) - start):
                data[place] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, rng.integers(256)])
            (tmp_path / name).write_bytes(data)
            found = read_exif(tmp_path / name)
            numbers = (found.exposure_s, found.iso, found.aperture, found.focal_mm, found.focal_35mm)
            assert all(number is None or 0 < number < np.inf for number in numbers)
    assert capfd.readouterr() == ("", "")
