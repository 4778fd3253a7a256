"""What docs/reference/file-formats.md says of each kind of photograph's file, row by row, by files of known pixels."""

import itertools
import re
import struct
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
import tifffile
from PIL import Image

from capture.photographs.images import read_image
from capture.photographs.raw import read_raw
from scene.errors import CaptureError
from scene.frames import PEDESTAL, WHITE, decode
from tests.capture.conftest import mosaic_of, write_dng

PAGE = (Path(__file__).parents[2] / "docs/reference/file-formats.md").read_text()
ROWS = [
    (file, holds.partition(" → ")[0], verdict)
    for file, *cells in re.findall(r"^\| ([^|`]+) \| ([^|]*) \| ([^|]*) \|$", PAGE.split("## Lights")[0], re.M)
    for verdict, cell in zip(("read", "refused"), cells, strict=True)
    for holds in re.findall("<li>(.*?)</li>", cell)
]
"""(file, what it holds, what becomes of it): the entries of the page's table by kinds."""
HEIGHT, WIDTH = 36, 50
KINDS = {}
"""(file, what it holds) of a row: what writes such files into a folder, and yields (path, RGB or words refused by).

A third value is by how much a lossy file may be off.
"""
LOSSY = 3 / 255


def scene():
    """RGB (H, W, 3), 0.1 to 0.9: no two channels, rows, columns or corners can be confused."""
    v, u = np.mgrid[:HEIGHT, :WIDTH] / np.array([HEIGHT, WIDTH])[:, None, None]
    grain = np.random.default_rng(0).uniform(0, 0.02, (HEIGHT, WIDTH, 3))
    return np.stack([0.55 + 0.3 * u, 0.3 + 0.2 * v, 0.1 + 0.15 * u * v], -1) + grain


RGB = scene()
U8, U16, FLOAT = (RGB * 255).round().astype("u1"), (RGB * 65535).round().astype("u2"), RGB.astype("f4")
AS_U8, AS_U16 = U8 / 255, U16 / 65535


def kind(file, holds):
    """Register what writes the files of a row."""

    def register(write):
        KINDS[file, holds] = write
        return write

    return register


def tiff(folder, values, **how):
    path = folder / "a.tif"
    path.unlink(missing_ok=True)
    tifffile.imwrite(
        path, values, **{"photometric": "rgb" if values.ndim == 3 else "minisblack", "metadata": None} | how
    )
    return path


def planes(values):
    return np.ascontiguousarray(np.moveaxis(values, -1, 0))


@kind("TIFF", "gray or RGB, of 8 or 16 bits")
def plain(folder):
    for values, truth in ((U8, AS_U8), (U16, AS_U16)):
        yield tiff(folder, values), truth
        yield tiff(folder, values[..., 0].copy()), np.repeat(truth[..., :1], 3, -1)
        assert cv2.imwrite(str(folder / "a.tif"), values[..., ::-1])
        yield folder / "a.tif", truth


def packed_tiff(path, values, bits, order):
    """Write values (H, W, S) of any bits: rows are filled up to bytes. MaxSampleValue lies."""
    height, width, count = values.shape
    rows = ["".join(f"{value:0{bits}b}" for value in row) for row in values.reshape(height, -1)]
    data = b"".join(int(row + "0" * (-len(row) % 8), 2).to_bytes(-(-len(row) // 8), "big") for row in rows)
    start = 8 + len(data) + len(data) % 2
    tags = [(256, 4, width), (257, 4, height), (258, 3, bits), (259, 3, 1), (262, 3, 2 if count == 3 else 1)]
    tags += [(273, 4, 8), (277, 3, count), (278, 4, height), (279, 4, len(data)), (281, 3, 2**bits // 3)]
    out = (b"II" if order == "<" else b"MM") + struct.pack(order + "HI", 42, start) + data + b"\0" * (len(data) % 2)
    out += struct.pack(order + "H", len(tags))
    for code, form, value in tags:
        several = code == 258 and count == 3
        text = struct.pack(order + "HH", value, 0) if form == 3 else struct.pack(order + "I", value)
        place = struct.pack(order + "I", start + 6 + 12 * len(tags))
        out += struct.pack(order + "HHI", code, form, 3 if several else 1) + (place if several else text)
    path.write_bytes(out + bytes(4) + struct.pack(order + "3H", bits, bits, bits))


@kind("TIFF", "1, 2, 4, 10, 12 or 14 bits")
def bits(folder):
    for count, order, samples in itertools.product((1, 2, 4, 10, 12, 14), "<>", (1, 3)):
        values = (RGB[..., :samples] * (2**count - 1)).round().astype(int)
        packed_tiff(folder / "a.tif", values, count, order)
        yield folder / "a.tif", np.broadcast_to(values / (2**count - 1), RGB.shape)
    # The greatest value of each picture, as some programs write it, is no white: it would scale each its own way.
    yield tiff(folder, U16, extratags=[(281, 3, 3, (30000,) * 3, True), (341, 3, 3, (30000,) * 3, True)]), AS_U16


@kind("TIFF", "floating point of 16, 32 or 64 bits")
def floats(folder):
    for form in ("f2", "f4", "f8"):
        values = RGB.astype(form)
        for options in ({}, {"byteorder": ">"}, {"compression": "deflate", "predictor": 3}):
            yield tiff(folder, values, **options), values
        yield tiff(folder, values[..., 0].copy()), np.repeat(values[..., :1], 3, -1)
        yield tiff(folder, np.dstack([values, values[..., :1] / 2]), extrasamples=["unassalpha"]), values


@kind("TIFF", "strips or tiles, one plane after the other, BigTIFF, both byte orders")
def layouts(folder):
    layouts = ({"rowsperstrip": 5}, {"tile": (16, 32)}, {"bigtiff": True}, {"byteorder": ">"}, {})
    for values, how, packing in itertools.product((U8, U16, FLOAT), layouts, (None, "deflate")):
        truth = values / (1 if values.dtype == "f4" else np.iinfo(values.dtype).max)
        yield tiff(folder, values, compression=packing, **how), truth
        yield tiff(folder, planes(values), planarconfig="separate", compression=packing, **how), truth


@kind("TIFF", "LZW, deflate, PackBits, Zstandard, LZMA, CCITT, JPEG, JPEG 2000, JPEG XL, WebP, LERC; predictors")
def compressions(folder):
    for name in ("lzw", "deflate", "packbits", "zstd", "lzma", "lerc", "jpeg2000", "jpegxl"):
        yield tiff(folder, U16, compression=name, rowsperstrip=7), AS_U16
    for name in ("lzw", "deflate", "zstd"):
        yield tiff(folder, U16, compression=name, predictor=True), AS_U16
        yield tiff(folder, planes(U8), compression=name, predictor=True, planarconfig="separate"), AS_U8
    yield tiff(folder, U8, compression="webp", compressionargs={"lossless": True}), AS_U8
    # Even: the colours of JPEG are halved.
    smooth = np.broadcast_to(U8[:1, :1], (32, 48, 3)).copy()
    yield tiff(folder, smooth, compression="jpeg"), smooth / 255, LOSSY
    Image.fromarray(smooth).convert("YCbCr").save(folder / "a.tif", compression="jpeg")
    yield folder / "a.tif", smooth / 255, LOSSY
    for name in ("group3", "group4"):
        Image.fromarray(U8[..., 0] > 170).save(folder / "a.tif", compression=name)
        yield folder / "a.tif", np.repeat(U8[..., :1] > 170, 3, -1)


@kind("TIFF", "a palette; MinIsWhite; alpha; any orientation")
def tags_that_change_pixels(folder):
    indices = np.arange(HEIGHT * WIDTH).reshape(HEIGHT, WIDTH).astype("u1")
    colours = np.random.default_rng(1).integers(0, 256, (3, 256)).astype("u2")
    for scale in (257, 256, 1):
        yield tiff(folder, indices, photometric="palette", colormap=colours * scale), colours.T[indices] / 255
    for values in (U8, U16):
        most = np.iinfo(values.dtype).max
        gray = np.repeat(values[..., :1], 3, -1) / most
        yield tiff(folder, most - values[..., 0], photometric="miniswhite"), gray
        yield tiff(folder, np.dstack([values[..., 0], values[..., 1]]), photometric="minisblack", planarconfig="contig",
                   extrasamples=["unassalpha"]), gray  # fmt: skip
        for alpha in ("assocalpha", "unassalpha", "unspecified"):
            covered = np.dstack([values, np.full((HEIGHT, WIDTH), 7, values.dtype)])
            yield tiff(folder, covered, extrasamples=[alpha]), values / most
        for way in range(1, 9):
            yield tiff(folder, values, extratags=[(274, 3, 1, way, True)]), values / most
    yield tiff(folder, U8[..., 0] <= 170, photometric="miniswhite"), np.repeat(U8[..., :1] > 170, 3, -1)


def pages(folder, *written, **how):
    path = folder / "a.tif"
    with tifffile.TiffWriter(path, **how) as file:
        for values, options in written:
            file.write(values, **{"photometric": "rgb"} | options)
    return path


@kind("TIFF", "thumbnails, a pyramid, or masks beside the picture, in pages or sub-pages")
def copies(folder):
    small, copy = np.ascontiguousarray(U8[::4, ::4]), {"subfiletype": 1}
    half = (np.ascontiguousarray(U16[::2, ::2]), copy)
    mask = (U8[..., 0] > 90, {"photometric": "minisblack", "subfiletype": 4})
    for marked in (copy, {}):
        yield pages(folder, (small, marked), (U16, {})), AS_U16
        yield pages(folder, (U16, {}), (np.ascontiguousarray(U16[::2, ::2]), marked), (small, marked)), AS_U16
    yield pages(folder, (U16, {}), mask), AS_U16
    yield pages(folder, mask, (U16, {})), AS_U16
    yield pages(folder, (U16, {"subifds": 1}), half), AS_U16
    yield pages(folder, (small, {**copy, "subifds": 1}), (U16, {})), AS_U16


@kind("TIFF", "several pictures: pages, an ImageJ stack, a volume")
def several(folder):
    gray, said = {"photometric": "minisblack"}, r"holds \d pictures \(pages\)"
    yield pages(folder, (U16, {}), (U16 // 2, {})), said
    for how in ({"imagej": True}, {"ome": True}, {}):
        yield pages(folder, (planes(U16), gray), **how), said
    # One page, and the other planes behind it, of which the description alone tells.
    for how in ({"imagej": True}, {}):
        yield pages(folder, (planes(U16), {**gray, "truncate": True}), **how), said
    yield pages(folder, (planes(U16), {**gray, "volumetric": True, "tile": (3, 16, 16)})), said


@kind("TIFF", "CMYK, CIELab, a mosaic, YCbCr without JPEG; LogLuv")
def colours(folder):
    said = "is of the colour space"
    Image.fromarray(U8).convert("CMYK").save(folder / "a.tif")
    yield folder / "a.tif", f"{said} SEPARATED"
    for name in ("cielab", "ycbcr", "linear_raw"):
        yield tiff(folder, U8, photometric=name), said
    filters = [(33421, 3, 2, (2, 2), True), (33422, 1, 4, b"\0\1\1\2", True)]
    yield tiff(folder, U16[..., 0].copy(), photometric="cfa", extratags=filters), f"{said} CFA"
    luv = [cv2.IMWRITE_TIFF_COMPRESSION, cv2.IMWRITE_TIFF_COMPRESSION_SGILOG]
    assert cv2.imwrite(str(folder / "a.tif"), FLOAT, luv)
    yield folder / "a.tif", "is compressed by SGILOG"


@kind("TIFF", "more samples a pixel than its colours and alpha")
def samples(folder):
    for count, name in ((5, "rgb"), (8, "rgb"), (3, "minisblack"), (31, "minisblack")):
        many = np.repeat(U16[..., :1], count, -1)
        for values, how in ((many, "contig"), (planes(many), "separate")):
            yield tiff(folder, values, photometric=name, planarconfig=how), f"has {count} samples a pixel"


@kind("TIFF", "signed or complex numbers, whole numbers of 32 or 64 bits")
def numbers(folder):
    for form in ("i1", "i2", "i4", "u4", "u8", "i8", "c8"):
        yield tiff(folder, (RGB * 100).astype(form)), r"holds RGB values of \d+ bits, SampleFormat"
    yield tiff(folder, FLOAT[..., 0].copy(), photometric="miniswhite"), "holds MINISWHITE values of 32 bits"


@kind("TIFF", "values that are no numbers, or are marked as missing (GDAL)")
def missing(folder):
    for gap in (np.nan, np.inf):
        yield tiff(folder, np.where(RGB > 0.8, gap, RGB).astype("f4")), "values that are no numbers"
    mark = [(42113, 2, 0, "-9999", True)]
    yield tiff(folder, np.where(RGB > 0.8, -9999, RGB).astype("f4"), extratags=mark), "mark of missing data"


def exr(folder, channels, **header):
    OpenEXR.File(header, channels).write(str(folder / "a.exr"))
    return folder / "a.exr"


def by_letter(values):
    return {letter: np.ascontiguousarray(values[..., i]) for i, letter in enumerate("RGB")}


@kind("OpenEXR", "R, G, B or one channel, half or float, alpha and layers beside them; any compression")
def exr_channels(folder):
    for name in ("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"):
        packing = getattr(OpenEXR, f"{name}_COMPRESSION")
        values, off = (np.full_like(FLOAT, [0.5, 0.25, 0.125]), 1e-3) if name[0] in "BD" else (FLOAT, 0)
        yield exr(folder, {"RGB": values}, compression=packing), values, off
        yield exr(folder, by_letter(values.astype("f2")), compression=packing), values.astype("f2"), off
    yield exr(folder, {"Y": FLOAT[..., 0].copy()}), np.repeat(FLOAT[..., :1], 3, -1)
    yield exr(folder, {"RGBA": np.dstack([FLOAT, np.full((HEIGHT, WIDTH), 0.5, "f4")])}), FLOAT
    mixed = by_letter(FLOAT) | {"G": by_letter(RGB.astype("f2"))["G"]}
    yield exr(folder, dict(mixed)), np.dstack(list(mixed.values()))
    yield exr(folder, {**by_letter(FLOAT), **{f"diffuse.{c}": x for c, x in by_letter(FLOAT / 3).items()}}), FLOAT
    yield exr(folder, {**by_letter(FLOAT), "Z": FLOAT[..., 0] * 9}), FLOAT


@kind("OpenEXR", "scan lines or tiles")
def exr_storage(folder):
    yield exr(folder, {"RGB": FLOAT}, lineOrder=OpenEXR.DECREASING_Y), FLOAT
    tiles = OpenEXR.TileDescription()
    tiles.xSize = tiles.ySize = 16
    tiles.mode = OpenEXR.ONE_LEVEL
    yield exr(folder, {"RGB": FLOAT}, type=OpenEXR.tiledimage, tiles=tiles), FLOAT


def box(left, top, width, height):
    return np.array([left, top], "i4"), np.array([left + width - 1, top + height - 1], "i4")


@kind("OpenEXR", "a data window unlike the display window")
def windows(folder):
    for stored, (left, top, width, height) in itertools.product(
        [(0, 0), (5, 3), (-6, -4), (-6, 3)], [(0, 0, WIDTH, HEIGHT), (0, 0, 80, 70), (-3, 2, 30, 20), (4, 4, 90, 12)]
    ):
        truth = np.zeros((height, width, 3))
        for v, u in itertools.product(range(height), range(width)):
            row, column = v + top - stored[1], u + left - stored[0]
            if 0 <= row < HEIGHT and 0 <= column < WIDTH:
                truth[v, u] = FLOAT[row, column]
        frame = {"dataWindow": box(*stored, WIDTH, HEIGHT), "displayWindow": box(left, top, width, height)}
        yield exr(folder, {"RGB": FLOAT}, **frame), truth


@kind("OpenEXR", "chromaticities")
def chromaticities(folder):
    wide = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
    yield exr(folder, {"RGB": FLOAT}, chromaticities=wide), FLOAT


def parts(folder, *channels):
    OpenEXR.File([OpenEXR.Part({}, one, str(i)) for i, one in enumerate(channels)]).write(str(folder / "a.exr"))
    return folder / "a.exr"


@kind("OpenEXR", "parts, the first of which alone is a picture")
def exr_parts(folder):
    yield parts(folder, {"RGB": FLOAT}, {"Z": FLOAT[..., 0] * 9}), FLOAT


REFUSED = "several pictures, layers alone, deep pixels, luminance and chroma, whole numbers, channels of fewer pixels"


@kind("OpenEXR", REFUSED)
def exr_refused(folder):
    yield parts(folder, {"RGB": FLOAT}, {"RGB": FLOAT / 2}), "holds 2 parts"
    yield parts(folder, {"Z": FLOAT[..., 0] * 9}, {"RGB": FLOAT}), "holds 2 parts"
    yield exr(folder, {f"diffuse.{c}": x for c, x in by_letter(FLOAT).items()}), "channels of the first are diffuse.B"
    yield exr(folder, {"Z": FLOAT[..., 0] * 9}), "channels of the first are Z"
    deep = np.empty((HEIGHT, WIDTH), object)
    for place in np.ndindex(deep.shape):
        deep[place] = np.full(1 + sum(place) % 3, 0.5, "f4")
    header = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    yield exr(folder, dict.fromkeys("RGBAZ", deep), **header), "deep"
    yield exr(folder, by_letter((RGB * 1000).astype("u4"))), "whole numbers"
    for steps, said in (
        ({"BY": 2, "RY": 2, "Y": 1}, "channels of the first are BY, RY, Y"),
        ({"B": 2, "G": 1, "R": 1}, "channels of fewer pixels"),
    ):
        # The writer takes a whole picture of every channel, and writes the first of its pixels.
        channels = {name: OpenEXR.Channel(FLOAT[..., 0].copy(), step, step) for name, step in steps.items()}
        yield exr(folder, channels), said


def dng(folder, values, white, more=(), **how):
    return write_dng(folder / "a.dng", values, black=None, white=white, more=more, **how)


def flat_scene(size=(HEIGHT, WIDTH)):
    """One colour everywhere: whatever is interpolated between filters stays what it is."""
    return np.broadcast_to([0.5, 0.3, 0.1], (*size, 3))


def mosaic(linear):
    return mosaic_of(linear, white=None)


@kind("DNG", "floating point; deflate, JPEG XL; a mosaic or every colour at every pixel")
def dng_read(folder):
    flat = flat_scene()
    for form, how in itertools.product(
        ("f2", "f4"), ({}, {"tile": (16, 32)}, {"compression": "deflate"}, {"compression": "deflate", "predictor": 3})
    ):
        yield dng(folder, mosaic(flat).astype(form), 1, **how), flat.astype(form)
        yield dng(folder, RGB.astype(form), 1, **how), RGB.astype(form)
    yield dng(folder, (mosaic(flat) * 4 + 0.5).astype("f4"), 9, [(50714, 5, 1, (1, 2), True)]), flat * 4 / 8.5
    bright = FLOAT.copy()
    bright[3:6, 3:6] = 7
    yield dng(folder, bright, 1), np.minimum(bright, 1)
    yield dng(folder, U16, 65535), AS_U16
    for packing in (8, 52546):
        code = (mosaic(flat) * 16000 + 383).round().astype("u2")
        black = [(50714, 3, 1, 383, True)]
        yield dng(folder, code, 16383, black, compression=packing), flat
        yield dng(folder, U16, 65535, compression=packing), AS_U16
        area = [*black, (50829, 4, 4, (2, 4, HEIGHT - 4, WIDTH - 2), True)]
        yield dng(folder, code, 16383, area, compression=packing), flat[2:-4, 4:-2]
        # The rows and columns of each filter lie together, as converters write them.
        apart = np.block([[code[::2, ::2], code[::2, 1::2]], [code[1::2, ::2], code[1::2, 1::2]]])
        fields = [*black, (50975, 4, 1, 2, True), (52547, 4, 1, 2, True)]
        yield dng(folder, apart, 16383, fields, compression=packing), flat
        table = [(50712, 3, 256, tuple((np.arange(256) ** 2).tolist()), True)]
        roots = np.sqrt(RGB * 255**2).round().astype("u1")
        yield dng(folder, roots, 255**2, table, compression=packing), (roots.astype(float) / 255) ** 2


def operation(number, *coefficients):
    """Return OpcodeList2 with one operation on each plane."""
    body = [
        struct.pack(">9I", 0, 0, 32, 48, plane, 1, 1, 1, len(coefficients) - 1)
        + struct.pack(f">{len(coefficients)}d", *coefficients)
        for plane in range(3)
    ]
    data = struct.pack(">I", 3) + b"".join(struct.pack(">I4sII", number, b"\1\3\0\0", 1, len(x)) + x for x in body)
    return [(51009, 7, len(data), data, True)]


@kind("DNG", "lossy JPEG")
def dng_lossy(folder):
    flat = (flat_scene((32, 48)) * 255).round()
    for more, truth in (([], flat / 255), (operation(8, 0, 0, 1.0), (flat / 255) ** 2)):
        yield dng(folder, flat.astype("u1"), 255, more, compression=34892, tile=(16, 16)), truth, LOSSY


@kind("DNG", "values bent by a curve of its own (OpcodeList2); a compression that nothing here decodes")
def dng_refused(folder):
    yield dng(folder, U16, 65535, operation(8, 0, 0, 1.0), compression=52546), "values bent by a curve"
    path = dng(folder, (mosaic(flat_scene()) * 16383).astype("u2"), 16383)
    data = path.read_bytes()
    entry = struct.pack("<HHIHH", 259, 3, 1, 1, 0)
    assert data.count(entry) == 1
    path.write_bytes(data.replace(entry, struct.pack("<HHIHH", 259, 3, 1, 9, 0)))
    yield path, "compression 9"


@kind("PNG", "gray, RGB, a palette, alpha; 1 to 16 bits")
def png(folder):
    path = folder / "a.png"
    for values, truth in ((U8, AS_U8), (U16, AS_U16)):
        alpha = np.full((HEIGHT, WIDTH), 7, values.dtype)
        for written, expected in ((values, truth), (np.dstack([values, alpha]), truth), (values[..., 0], None)):
            order = [2, 1, 0, 3][: written.shape[2]] if written.ndim == 3 else slice(None)
            assert cv2.imwrite(str(path), written[..., order] if written.ndim == 3 else written)
            yield path, np.repeat(truth[..., :1], 3, -1) if expected is None else expected
    turned = Image.Exif()
    turned[274] = 6
    few = Image.fromarray(U8).quantize(16)
    for image in (Image.fromarray(U8), few, Image.fromarray(U8[..., 0] > 170)):
        image.save(path, exif=turned)
        yield path, np.asarray(image.convert("RGB")) / 255


@kind("JPEG", "gray or colour, any orientation")
def jpeg(folder):
    smooth = np.broadcast_to(U8[:1, :1], (32, 48, 3)).copy()
    for way in range(1, 9):
        turned = Image.Exif()
        turned[274] = way
        Image.fromarray(smooth).save(folder / "a.jpg", exif=turned, quality=100)
        yield folder / "a.jpg", smooth / 255, LOSSY
    Image.fromarray(smooth[..., 0]).save(folder / "a.jpg", quality=100)
    yield folder / "a.jpg", np.repeat(smooth[..., :1], 3, -1) / 255, LOSSY


@kind("JPEG", "CMYK")
def jpeg_cmyk(folder):
    Image.fromarray(U8).convert("CMYK").save(folder / "a.jpg")
    yield folder / "a.jpg", "is of the colour space CMYK"


@kind("PGM, PPM", "a greatest value below all bits set")
def pnm(folder):
    for most, letter in itertools.product((100, 255, 1023, 4095, 65535), "56"):
        values = (RGB * most).round()
        written = values if letter == "6" else values[..., 0]
        data = written.astype(">u2" if most > 255 else "u1").tobytes()
        path = folder / f"a.{'ppm' if letter == '6' else 'pgm'}"
        path.write_bytes(f"P{letter}\n# by a camera\n{WIDTH} {HEIGHT}\n{most}\n".encode() + data)
        truth = values / most if letter == "6" else np.repeat(values[..., :1], 3, -1) / most
        yield path, truth
        plain = " ".join(str(int(value)) for value in written.ravel())
        path.write_text(f"P{int(letter) - 3}\n{WIDTH} {HEIGHT}\n{most}\n{plain}\n")
        # The decoder brings 8 bits that are written as text to 255.
        yield path, truth, 1 / 255 if most < 255 else 0


@kind("TGA, BMP", "gray or RGB of 8 bits")
def tga(folder):
    for suffix in ("tga", "bmp"):
        for values in (U8, U8[..., 0]):
            Image.fromarray(values).save(folder / f"a.{suffix}")
            yield folder / f"a.{suffix}", (values if values.ndim == 3 else np.repeat(values[..., None], 3, -1)) / 255


def test_the_page_and_this_file_name_the_same_kinds():
    assert {row[:2] for row in ROWS} == set(KINDS)
    assert len(ROWS) == len(KINDS) > 20


@pytest.mark.parametrize(("file", "holds", "claim"), ROWS, ids=lambda text: re.sub(r"\W+", "-", text)[:30])
def test_a_row_is_true(tmp_path, file, holds, claim):
    tested = 0
    for path, expected, *off in KINDS[file, holds](tmp_path):
        read = read_raw if path.suffix == ".dng" else lambda path: read_image(path, "linear")
        if claim == "refused":
            with pytest.raises(CaptureError, match=expected) as error:
                read(path)
            assert not re.search("corrupt|cut short|from the camera again", str(error.value)), "another cause"
            assert str(error.value).startswith(f"{path}: ")
        else:
            codes = read(path).codes
            found, truth = decode(codes), np.asarray(expected, float)
            assert found.shape == truth.shape
            rounding = 1.01 / (WHITE - PEDESTAL) if codes.dtype == np.uint16 else 5e-4 * truth
            assert np.all(np.abs(found - truth) <= rounding + sum(off)), claim
        tested += 1
    assert tested
