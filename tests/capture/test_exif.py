"""EXIF as cameras write it, and as they do not."""

import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from capture.camera.exif import Exif, read_exif


def jpeg(path, fields, main=()):
    image = Image.new("RGB", (60, 40))
    exif = image.getexif()
    exif.get_ifd(0x8769).update(fields)
    exif.update(main)
    image.save(path, exif=exif)
    return path


def test_what_a_camera_writes(tmp_path):
    path = jpeg(
        tmp_path / "a.jpg",
        {
            0x829A: IFDRational(1, 125),
            0x829D: IFDRational(56, 10),
            0x9206: IFDRational(135, 100),
            0x8827: 200,
            0x920A: IFDRational(50, 1),
            0xA405: 75,
            0xA20E: IFDRational(5472000, 899),
            0xA20F: IFDRational(3648000, 599),
            0xA210: 2,
            0xA002: 60,
            0x9003: "2026:11:21 09:30:12",
            0x9291: "34",
        },
        {0x10F: "Canon", 0x110: "EOS 70D", 0x112: 6},
    )
    found = read_exif(path)
    assert found.exposure_s == pytest.approx(1 / 125)
    assert (found.iso, found.aperture, found.focal_mm, found.focal_35mm) == (200, 5.6, 50, 75)
    assert found.pixels_per_mm == pytest.approx((5472000 / 899 / 25.4, 3648000 / 599 / 25.4))
    assert found.width_px == 60
    assert found.subject_mm == pytest.approx(1350)
    assert found.camera == "Canon EOS 70D"


def test_absence_and_zeros(tmp_path, capsys):
    """A camera that does not know its lens writes 0 mm at f/0: that is nothing."""
    path = jpeg(tmp_path / "a.jpg", {0x829A: IFDRational(0, 1), 0x829D: IFDRational(0, 0), 0x920A: IFDRational(0, 1)})
    found = read_exif(path)
    assert (found.exposure_s, found.aperture, found.focal_mm) == (None, None, None)
    far = jpeg(tmp_path / "d.jpg", {0x9206: IFDRational(0xFFFFFFFF, 1)})
    assert read_exif(far).subject_mm is None
    (tmp_path / "b.pgm").write_bytes(b"P5\n1 1\n255\nx")
    (tmp_path / "c.jpg").write_bytes(b"\xff\xd8\xff\xe1\x00\x10Exif\0\0II*\0\xff\xff")
    for name in ("b.pgm", "c.jpg", "absent.jpg"):
        assert read_exif(tmp_path / name) == Exif()
    assert capsys.readouterr() == ("", "")


def test_a_real_raw_file_without_exposure(shared):
    found = read_exif(shared("real/raw_dng/colorchart.dng"))
    assert found.camera == "Canon Canon EOS Kiss X4"
    assert (found.exposure_s, found.iso, found.aperture) == (None, None, None)
