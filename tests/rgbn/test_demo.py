"""The whole way on the fixture: what the demo must reach, the contract's files, resuming."""

import json
import re
import shutil
import tomllib
from fnmatch import fnmatch

import numpy as np
import pytest

from formats.normal_maps import read_normal_map
from scene.normals import angular_error_deg
from tests.conftest import FIXTURE

pytestmark = [pytest.mark.slow, pytest.mark.render]


@pytest.fixture(scope="session")
def demo(tmp_path_factory, rgbn_process):
    """The demo's output folder and summary."""
    out = tmp_path_factory.mktemp("demo") / "out"
    run = rgbn_process("demo", "--out", out, "--json")
    assert run.returncode == 0, run.stderr
    return out, json.loads(run.stdout)


def test_the_fixture_is_small_and_whole():
    """That its truth is that of its files, the demo finds."""
    assert sum(path.stat().st_size for path in FIXTURE.rglob("*") if path.is_file()) < 20e6
    names = sorted(path.name for path in (FIXTURE / "raw").iterdir())
    assert names == ["ambient_000.dng", *(f"flash_{i:03d}.dng" for i in range(12))]
    text, truth = (FIXTURE / "session.toml").read_text(), json.loads((FIXTURE / "truth.json").read_text())
    assert [ball["kind"] for ball in tomllib.loads(text)["spheres"]] == [ball["kind"] for ball in truth["spheres"]]
    assert "truth" not in text, "it is for judging: the session says nothing of it"


def test_every_file_is_in_the_reference(demo):
    page = (FIXTURE.parents[1] / "docs" / "reference" / "output-folder.md").read_text()
    named = {name.replace("METHOD", "*") for name in re.findall(r"`([^`\s]+)`", page)}
    # What lies in these is a session of its own, or pictures for people.
    named |= {f"{name}/*" for name in ("frames", "align", "compare", "twin", ".rgbn") if f"{name}/" in named}
    files = [path.relative_to(demo[0]) for path in demo[0].rglob("*") if path.is_file()]
    assert len(files) > 50
    assert not [file for file in files if not any(fnmatch(text, one) for one in named for text in (file, file.name))]


@pytest.mark.parametrize(
    ("key", "most"),
    [
        ("direction_median_deg", 0.5), ("direction_max_deg", 1.5), ("intensity_rms_percent", 3),
        ("sphere_max_px", 0.5), ("registration_rms_px", 1), ("truth_median_deg", 1),
    ],
)  # fmt: skip
def test_lights_balls_registration_and_truth_are_as_exact_as_they_were(demo, key, most):
    assert demo[1]["truth_check"][key]["value"] <= most
    assert demo[1]["truth_check"]["mask_overlap"]["value"] >= 0.97
    assert demo[1]["calibrate"]["model"] == "near"


def test_the_twin_fails_as_the_frames_do(demo):
    """As large, and at the same places: the twin lacks the table and the noise alone."""
    methods = demo[1]["compare"]["methods"]
    for row in methods.values():
        assert 0.8 < row["twin"]["median_deg"] / row["real"]["median_deg"] < 1.25
        assert row["pearson"] > 0.5
        assert row["spearman"] > 0.5
        assert row["real"]["median_deg"] < 3


def test_the_twin_is_of_the_true_material(demo):
    """fixtures/make_bumpy.py: a satin coat of roughness 0.22 over 30 % of a matte surface, which no model here has."""
    material = demo[1]["twin"]["material"]
    assert material["model"] == "rough plastic"
    assert abs(material["roughness"] / 0.22 - 1) < 0.1
    assert material["relative_rmse"] < 0.016
    assert len(material["relative_rmse_per_frame"]) == 12
    page = (demo[0] / "report.html").read_text()
    # What it is in a sentence, by what evidence behind it.
    assert all(part in page for part in material["sentence"].split(": "))
    assert f'data-value="{material["relative_rmse"]!r}"' in page


def test_the_twin_predicts_frames_that_it_was_not_fitted_to(demo):
    twin = demo[1]["twin"]
    found = twin["held_out"]
    assert sorted([*found["fitted"], *found["predicted"]]) == [f"flash_{i:03d}" for i in range(12)]
    # Not so well as those that it was fitted to, and never much worse.
    assert twin["material"]["relative_rmse"] < found["relative_rmse_fitted"] < 0.03
    assert found["relative_rmse_fitted"] < found["relative_rmse_lit"] < 0.05
    assert f'data-value="{found["relative_rmse_lit"]!r}"' in (demo[0] / "report.html").read_text()


def test_known_light_errors_are_within_the_stated_sigma(demo):
    """Honest: true directions lie within three stated sigmas of the calibrated ones, nearly all."""
    lights = json.loads((demo[0] / "lights.json").read_text())
    truth = json.loads((FIXTURE / "truth.json").read_text())
    # Both hold at the object's centre, found by registration in one case and known in the other.
    found = np.array([row["direction"] for row in lights["frames"]])
    off = angular_error_deg(found, np.array(truth["directions_at_object"]))
    sigma = np.array([row["direction_sigma_deg"] for row in lights["frames"]])
    moved = np.linalg.norm(np.array(lights["reference_point_mm"]) - truth["object_centre_mm"])
    assert np.mean(off < 3 * np.sqrt(2) * sigma + np.degrees(moved / 700)) >= 0.9


def test_every_file_of_the_contract(demo):
    out, summary = demo
    names = (
        "report.html summary.json lights.json light_directions.txt light_intensities.txt filenames.txt lights.lp "
        "spheres.json camera.json pose.json mask.png normals/truth.npy normals/truth.png normals/truth_sigma.npy "
        "normals/ls.npy normals/ls.png albedo/ls.npy normals/iterative.npy albedo/iterative.npy twin/session.toml "
        "twin/normals/ls.npy twin/normals/iterative.npy report.pdf"
    )
    assert [name for name in names.split() if not (out / name).is_file()] == []
    assert not list(out.rglob("*.tmp"))

    lights = json.loads((out / "lights.json").read_text())
    assert set(lights["frames"][0]) == {
        "name", "direction", "position_mm", "intensity", "direction_sigma_deg", "intensity_sigma", "flags"
    }  # fmt: skip
    assert lights["model"] == "near"
    intensity = np.loadtxt(out / "light_intensities.txt")
    np.testing.assert_allclose(intensity.mean(0), 1, atol=1e-6)
    directions = np.loadtxt(out / "light_directions.txt")
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)
    lp = (out / "lights.lp").read_text().splitlines()
    assert int(lp[0]) == len(directions) == len(lp) - 1

    spheres = json.loads((out / "spheres.json").read_text())
    assert {"kind", "center_px", "radius_px", "center_mm", "sigma_px", "score"} <= set(spheres[0])
    pose = json.loads((out / "pose.json").read_text())
    rotation = np.array(pose["camera_from_scan"])[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    assert {"residual_px", "sigma_mm", "sigma_deg"} <= set(pose)

    truth = np.load(out / "normals" / "truth.npy")
    assert truth.dtype == np.float32
    assert truth.shape == (480, 640, 3)
    known = np.isfinite(truth[..., 0])
    np.testing.assert_allclose(np.linalg.norm(truth[known], axis=1), 1, atol=1e-5)
    picture = read_normal_map(out / "normals" / "truth.png", 480, 640)
    assert np.nanmax(angular_error_deg(picture, truth)) < 0.01
    assert summary == json.loads((out / "summary.json").read_text())


def test_the_report_stands_alone(demo):
    page = (demo[0] / "report.html").read_text()
    assert 'src="http' not in page
    assert "<script src" not in page
    assert len(page) < 15e6


@pytest.mark.full
def test_the_twin_is_a_session(demo, rgbn_process, tmp_path):
    """`process` accepts the twin's folder: known lights, given normals, the same solver result."""
    out = tmp_path / "out"
    run = rgbn_process("process", demo[0] / "twin", "--out", out, "--method", "iterative", "--json")
    assert run.returncode == 0, run.stderr
    again = json.loads(run.stdout)["compare"]["methods"]["iterative"]["real"]["median_deg"]
    assert again == pytest.approx(demo[1]["compare"]["methods"]["iterative"]["twin"]["median_deg"], rel=0.02)


@pytest.mark.full
def test_a_photographed_twin_is_of_the_sessions_kind(demo, rgbn_process, tmp_path):
    """Mosaics as noisy as the photographs, which the methods then see; the rendering's engine is the one asked for."""
    from scene.store import Store

    out = tmp_path / "out"
    shutil.copytree(demo[0], out)
    run = rgbn_process("twin", FIXTURE, "--out", out, "--photograph", "--engine", "many", "--json")
    assert run.returncode == 0, run.stderr
    assert "solve ..." not in run.stderr, "what is current is not done again"
    facts = json.loads(run.stdout)["twin"]
    assert (facts["engine"], facts["sensor"]["cfa"]) == ("many", "RGGB")
    # What fixtures/make_bumpy.py photographed with.
    assert facts["sensor"]["full_well_e"] == pytest.approx(45000, rel=0.2)
    assert len(list((out / "twin" / "flash").glob("*.dng"))) == 12
    clean, noisy = Store(demo[0] / "twin").load_frames(), Store(out / "twin").load_frames()
    assert noisy.is_mosaic
    assert not clean.is_mosaic
    dark = noisy.frame(0)[:80, :120]
    assert clean.frame(0)[:90, :130].max() == 0
    read = facts["sensor"]["read_noise_e"] / facts["sensor"]["full_well_e"]
    # Interpolated colours are means of two and four: a little calmer than what was read out.
    assert 0.4 * read < dark.std() < 1.2 * read
    truth = np.load(out / "normals" / "truth.npy")
    twin, real = (
        np.nanmedian(angular_error_deg(store.load_normals("ls"), truth)) for store in (Store(out / "twin"), Store(out))
    )
    assert twin == pytest.approx(real, rel=0.15), "of the fitted material, it errs as the photographs do"


@pytest.mark.full
def test_mitsuba_alone_renders_the_exported_twin(demo, rgbn_process, tmp_path):
    """`rgbn export --format mitsuba`, then Mitsuba's own command line: the frames that `rgbn twin` rendered."""
    from scene.store import Store
    from tests.twin.test_twin_scene import stock

    out = tmp_path / "out"
    shutil.copytree(demo[0], out)
    run = rgbn_process("export", FIXTURE, "--out", out, "--format", "mitsuba")
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip() == str(out / "export" / "scene.xml")
    assert "solve ..." not in run.stderr, "what is current is not done again"
    frames, mask = Store(out / "twin").load_frames(), Store(out).load_mask()
    index = 3
    theirs = stock(out / "export", frames.names[index], 64)
    ours, other = frames.frame(index), frames.frame(index + 1)
    inside = mask & (ours.min(-1) > 0.01)
    assert inside.sum() > 1000
    difference = np.abs(theirs - ours)[inside].mean() / ours[inside].mean()
    assert difference < 0.03
    assert np.abs(theirs - other)[inside].mean() / ours[inside].mean() > 5 * difference


def test_python_goes_on_with_what_the_command_line_made(demo):
    """`rgbn.open` of the demo's folder: nothing runs again, and its known truth is not lost."""
    import rgbn

    out, summary = demo
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.suffix in {".npy", ".json", ".html"}}
    session = rgbn.open(out)
    assert session.path == FIXTURE
    assert session.summary["truth_check"] == summary["truth_check"]
    rows = {(row["method"], row["frames"]): row for row in session.errors}
    for (method, frames), row in rows.items():
        assert row["median_deg"] == summary["compare"]["methods"][method][frames]["median_deg"]
        off = np.nanmedian(session.error_deg(method, twin=frames == "twin")[session.mask])
        assert off == pytest.approx(row["median_deg"], abs=1e-3)
    assert len(rows) == 4
    assert session.report == out / "report.html"
    after = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.suffix in {".npy", ".json", ".html"}}
    assert after == before
