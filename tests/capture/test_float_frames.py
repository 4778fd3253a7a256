"""Photographs in floating point: where they clip, what stands for 1.0, and that a rendering is taken as it is."""

import numpy as np
import pytest
import tifffile

from capture.audit.frame_facts import facts_of
from capture.photographs.decode import decode
from capture.photographs.develop import DevelopRecipe, read_photograph
from capture.photographs.images import read_image
from capture.photographs.kept import Kept
from capture.session.session import load_session
from fixtures.lit_surfaces import spiral
from formats.picture_files import write_exr
from scene.store import Store


def write(path, picture):
    if path.suffix == ".exr":
        write_exr(path, picture)
    else:
        tifffile.imwrite(path, picture, photometric="rgb")


def developed(folder, pictures, *, suffix=".tif", form="f4", table="", **others):
    """Write a session of pictures (F, H, W, 3), decode it, and return frames and report."""
    folder.mkdir()
    named = {f"flash_{i}": picture for i, picture in enumerate(pictures)} | others
    for name, picture in named.items():
        scaled = (picture * 65535).round() if form == "u2" else picture
        write(folder / f"{name}{suffix}", scaled.astype(form))
    table += "".join(f'{name} = "{name}{suffix}"\n' for name in others)
    (folder / "session.toml").write_text(f'[frames]\nflash = "flash_*{suffix}"\nlinear = true\n{table}')
    return decode(load_session(folder), Store(folder / "out"))


def overexposed(report):
    return [text.split(":")[0] for text in report.warnings if "overexposed" in text]


@pytest.mark.parametrize("suffix", [".tif", ".exr"])
@pytest.mark.parametrize("half", [False, True])
def test_clipped_floats_are_clipped_integers(tmp_path, scene_pictures, suffix, half):
    """The same photographs in both ways: the same samples are not believed, and the same frames are named."""
    pictures = np.clip(scene_pictures(6, shape=(120, 160)) * 2.5, 0, 1)
    table = f"half = {str(half).lower()}\n"
    floats, of_floats = developed(tmp_path / "float", pictures, suffix=suffix, table=table)
    whole, of_whole = developed(tmp_path / "whole", pictures, form="u2", table=table)
    assert whole.saturated().mean() > 0.05
    # Half floats round what lies within 0.0003 of the limit.
    assert np.mean(floats.saturated() != whole.saturated()) < 1e-3
    full = (pictures == 1).any(-1)
    full = full.reshape(6, 60, 2, 80, 2).any((2, 4)) if half else full
    assert floats.saturated()[full].all()
    assert overexposed(of_floats) == overexposed(of_whole) != []
    shares = [[row["saturated_share"] for row in report.frames_table] for report in (of_floats, of_whole)]
    assert shares[0] == pytest.approx(shares[1], abs=2e-3)


@pytest.mark.parametrize("ends", [[1.0, 1.0, 1.0], [0.37, 0.37, 0.37], [255.0, 255.0, 255.0], [2.1, 1.0, 1.6]])
def test_wherever_the_values_end(tmp_path, scene_pictures, ends):
    """Also after white balance, where each channel ends at a value of its own."""
    pictures = np.clip(scene_pictures(6, shape=(120, 160)) * 2.5, 0, 1) * ends
    frames, report = developed(tmp_path / "a", pictures)
    # White balance lifts channels beyond the least end: those are left out too.
    certain = (pictures >= np.array(ends) * 0.9999).any(-1)
    assert certain.mean() > 0.05
    assert frames.saturated()[certain].all()
    assert not frames.saturated()[(pictures < 0.97 * min(ends)).all(-1)].any()
    assert overexposed(report)


def rendering(*, ground):
    """A ball on a ground, under a ring of distant lights, without noise: every pixel of the ground has one value."""
    v, u = np.mgrid[:120, :160]
    x, y = (u - 79.5) / 40, (59.5 - v) / 40
    inside = x * x + y * y < 1
    normals = np.stack([x, y, np.sqrt(np.where(inside, 1 - x * x - y * y, 1))], -1)
    normals[~inside] = [0, 0, 1]
    lights = spiral(np.full(8, np.sqrt(0.75)), turn=np.pi / 4)
    shading = np.clip(np.einsum("hwc,fc->fhw", normals, lights), 0, None)
    return (shading * np.where(inside, 0.5, ground))[..., None] * [1.0, 0.8, 0.6]


@pytest.mark.parametrize("ground", [0.0, 0.3, 0.9])
def test_a_rendering_has_no_end(tmp_path, ground):
    """A bright flat ground is no clipping, though all of its samples are the greatest of all frames."""
    frames, report = developed(tmp_path / "a", rendering(ground=ground))
    assert not frames.saturated().any()
    assert not overexposed(report)
    assert all(row["saturated_share"] == 0 for row in report.frames_table)


@pytest.mark.parametrize("scale", [1e-8, 1e-6, 3e-4, 1e4, 1e9])
@pytest.mark.parametrize("suffix", [".tif", ".exr"])
def test_only_ratios_count(tmp_path, scene_pictures, scale, suffix):
    """Watts or any other unit: all photographs of a session are divided by one power of two."""
    light = scene_pictures(4, shape=(60, 80)) + 0.05
    light[2] *= 0.3
    others = {"ambient": np.full((60, 80, 3), 0.04), "dark": np.full((60, 80, 3), 0.01)}
    found = {}
    for name, unit in (("plain", 1.0), ("scaled", scale)):
        (tmp_path / name).mkdir()
        more = {key: value * unit for key, value in others.items()}
        found[name], report = developed(tmp_path / name / "a", light * unit, suffix=suffix, **more)
        assert not any("same photograph" in text for text in report.warnings)
    plain, scaled = found["plain"].read(), found["scaled"].read()
    bright = plain > 0.1
    ratio = np.median(scaled[bright] / plain[bright])
    assert np.log2(ratio / scale) == pytest.approx(round(np.log2(ratio / scale)), abs=2e-3), "a power of two"
    # Roundings to half floats: of frames, dark frame and ambient frame.
    assert np.abs(scaled / ratio - plain).max() < 1e-3
    assert not found["scaled"].saturated().any()


def test_single_pixels_of_any_brightness_change_no_other(tmp_path, scene_pictures):
    """What is beyond the greatest half float counts as clipped."""
    picture = scene_pictures(1, shape=(60, 80))[0].astype("f4")
    sparks = picture.copy()
    sparks[5, 7] = sparks[9, 3] = 1e9
    codes = []
    for values in (picture, sparks):
        write(tmp_path / "a.tif", values)
        photograph = read_image(tmp_path / "a.tif", "linear", sensor_range=None)
        assert photograph.sensor_range == 1
        codes.append(photograph.codes)
    assert np.argwhere((codes[0] != codes[1]).any(-1)).tolist() == [[5, 7], [9, 3]]
    assert facts_of(codes[1], white=photograph.white).clipped_share == 2 / 4800


def test_what_a_watch_kept_is_read_again_as_it_is(tmp_path, scene_pictures):
    """Memory-mapped, with its clip level, at the scale of usual values; another scale is read from the file."""
    kept = Kept(tmp_path / "kept", "linear", half=False)
    for name, picture in zip("ab", (scene_pictures(1)[0], np.clip(scene_pictures(1)[0] * 2.5, 0, 1)), strict=True):
        write(tmp_path / f"{name}.tif", picture.astype("f4"))
        photograph = read_photograph(tmp_path / f"{name}.tif", DevelopRecipe("linear", False, tmp_path))
        kept.keep(name, photograph)
        again = kept.load(name)
        assert isinstance(again.codes, np.memmap)
        assert np.array_equal(again.codes, photograph.codes)
        assert (again.white, again.sensor_range) == (photograph.white, 1.0)
        assert again.white == (np.inf if name == "a" else 1.0)
        assert kept.load(name, sensor_range=2.0**-20) is None
