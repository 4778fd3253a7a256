"""The comparison on maps whose errors are known by construction."""

import json

import numpy as np
import pytest

import compare.compare as module
from compare.compare import compare
from compare.statistics.statistics import ALBEDO, statistics_rows
from scene.files import write_npy
from scene.normals import unit
from scene.pose import rotation_from_vector
from scene.store import Store


def some_truth(height=24, width=32):
    v, u = np.mgrid[0:height, 0:width]
    return unit(np.stack([(u - width / 2) / width, -(v - height / 2) / height, np.ones_like(u) * 0.6], -1))


def tilted(normals, degrees):
    """Return normals exactly `degrees` (a number, or one a pixel) away, each in a direction of its own."""
    rng = np.random.default_rng(8)
    side = unit(np.cross(normals, rng.normal(0, 1, normals.shape)))
    angle = np.radians(np.broadcast_to(degrees, normals.shape[:2]))[..., None]
    return np.cos(angle) * normals + np.sin(angle) * side


def save_truth(store: Store, truth, *, sigma=0.3, mask=None):
    store.save_truth(truth, np.full(truth.shape[:2], sigma))
    store.save_mask(np.ones(truth.shape[:2], bool) if mask is None else mask)


def test_every_error_is_the_one_that_was_put_in(store, write_normals):
    truth = some_truth()
    degrees = np.repeat([[1.0], [2.0], [7.0], [12.0]], 6, 0) * np.ones((24, 32))
    save_truth(store, truth)
    write_normals(store, "ls", tilted(truth, degrees))
    result = compare(store)
    real = result["methods"]["ls"]["real"]
    assert real["min_deg"] == pytest.approx(1, abs=1e-4)
    assert real["max_deg"] == pytest.approx(12, abs=1e-4)
    assert real["mean_deg"] == pytest.approx(5.5, abs=1e-4)
    assert real["median_deg"] == pytest.approx(4.5, abs=1e-4)
    assert (real["under_5_deg"], real["under_10_deg"], real["pixels"]) == (0.5, 0.75, 24 * 32)
    assert result["methods"]["ls"]["twin"] is None
    assert result["methods"]["ls"]["coverage"] == 1
    assert result["truth"] == {
        "pixels": 768,
        "sigma_deg_median": pytest.approx(0.3),
        "sigma_deg_q3": pytest.approx(0.3),
    }
    np.testing.assert_allclose(np.load(store.path("compare", "error_real_ls.npy")), degrees, atol=1e-4)
    # 95 % of the errors are up to 12: the next round end of scale is 15.
    assert result["error_scale_deg"] == 15
    assert sum(result["methods"]["ls"]["histogram"]["real"]) == 768
    json.dumps(result, allow_nan=False)


def test_what_lies_outside_the_mask_counts_for_nothing(store, write_normals):
    truth, mask = some_truth(), np.zeros((24, 32), bool)
    mask[5:15, 6:20] = True
    save_truth(store, truth, mask=mask)
    write_normals(store, "ls", tilted(truth, 3.0))
    write_normals(store, "hsh", tilted(truth, 3.0))
    first = compare(store)
    garbage = np.where(mask[..., None], tilted(truth, 3.0), np.random.default_rng(0).normal(0, 1, (24, 32, 3)))
    write_normals(store, "ls", garbage)
    second = compare(store)
    assert first == second
    assert first["methods"]["ls"]["real"]["pixels"] == 140 == first["mask_pixels"]
    assert np.isnan(np.load(store.path("compare", "error_real_ls.npy"))[~mask]).all()


def test_a_twin_that_is_the_capture_fails_exactly_alike(store, write_normals):
    truth, rng = some_truth(), np.random.default_rng(6)
    estimate = tilted(truth, rng.exponential(4, (24, 32)))
    save_truth(store, truth)
    write_normals(store, "ls", estimate)
    write_normals(store, "ls", estimate, "twin/normals")
    row = compare(store)["methods"]["ls"]
    assert row["pearson"] == pytest.approx(1)
    assert row["spearman"] == pytest.approx(1)
    assert row["median_difference_deg"] == 0
    assert row["correlation_pixels"] == 768
    assert row["real"] == row["twin"]


def test_real_and_twin_are_not_confused(store, write_normals):
    truth = some_truth()
    save_truth(store, truth)
    write_normals(store, "ls", tilted(truth, np.linspace(5, 7, 768).reshape(24, 32)))
    write_normals(store, "ls", tilted(truth, np.linspace(1, 3, 768).reshape(24, 32)), "twin/normals")
    row = compare(store)["methods"]["ls"]
    assert row["real"]["median_deg"] == pytest.approx(6, abs=1e-3)
    assert row["twin"]["median_deg"] == pytest.approx(2, abs=1e-3)
    assert row["median_difference_deg"] == pytest.approx(4, abs=1e-3)


def test_the_albedo_s_error_is_told_of_the_twin_within_the_mask(store, write_normals):
    truth, albedo = some_truth(), np.full((24, 32, 3), [0.5, 0.4, 0.2], np.float32)
    save_truth(store, truth, mask=np.arange(32) * np.ones((24, 1)) < 20)
    twin, off = Store(store.path("twin")), np.where(np.arange(32) < 5, 1.2, 1.0)[:, None] * [3.0, 1.0, 0.5]
    for folder in (store, twin):
        write_normals(folder, "ls", truth)
    write_npy(twin.path("truth_albedo.npy"), albedo)
    write_npy(twin.path("albedo", "ls.npy"), np.where(np.arange(32)[:, None] < 20, off * albedo, 9.0))
    real, found = statistics_rows(compare(store))
    assert [real[key] for key in ALBEDO] == [None] * 5
    # A quarter of the object is a fifth too bright.
    assert [found[key] for key in ALBEDO] == pytest.approx([0, 20, 5, 0, np.sqrt(75)], abs=1e-3)


def test_a_tilt_common_to_all_normals_is_told_apart_from_scatter(store, write_normals):
    truth = some_truth()
    save_truth(store, truth)
    turn = rotation_from_vector(np.radians([2.0, -3.0, 1.0]))
    write_normals(store, "ls", truth @ turn.T)
    write_normals(store, "hsh", tilted(truth, 4.0))
    methods = compare(store)["methods"]
    assert methods["ls"]["real_rotation_deg"] == pytest.approx(np.sqrt(14), abs=1e-3)
    assert methods["ls"]["real_median_unrotated_deg"] < 1e-3
    assert methods["hsh"]["real_rotation_deg"] < 1
    assert methods["hsh"]["real_median_unrotated_deg"] > 3


def test_without_truth_only_differences_are_told_and_no_error(store, write_normals):
    truth = some_truth()
    write_normals(store, "ls", truth)
    write_normals(store, "iterative", tilted(truth, 6.0))
    result = compare(store)
    assert not result["has_truth"]
    assert all(row["real"] is row["twin"] is None for row in result["methods"].values())
    (pair,) = result["between_methods"]
    assert (pair["a"], pair["b"]) == ("ls", "iterative")
    assert pair["median_deg"] == pytest.approx(6, abs=1e-3)
    assert all(row["median_to_others_deg"] == pair["median_deg"] for row in result["methods"].values())
    assert any("no ground truth" in text and "not accuracy" in text for text in result["notes"])
    # The step that should have made the truth warns of it; said twice, one fact would look like two.
    assert result["warnings"] == []
    assert not list(store.path("compare").glob("*"))


def test_an_unanswered_half_shows_as_coverage_and_a_method_without_answers_is_named(store, write_normals):
    truth = some_truth()
    save_truth(store, truth)
    half, none = truth.copy(), np.full_like(truth, np.nan)
    half[:12] = np.nan
    write_normals(store, "ls", half)
    write_normals(store, "tv", none)
    result = compare(store)
    assert result["methods"]["ls"]["coverage"] == 0.5
    assert result["methods"]["tv"]["real"] is None
    assert any("tv (real): no pixel" in text for text in result["warnings"])


def test_a_tolerance_counts_what_is_not_answered_as_outside(store, write_normals):
    truth = some_truth()
    save_truth(store, truth)
    half = tilted(truth, 2.0)
    half[:, : truth.shape[1] // 2] = np.nan
    write_normals(store, "ls", half)
    write_normals(store, "iterative", tilted(truth, 2.5))
    found = compare(store, tolerance_deg=3.0)["tolerance"]
    assert (found["method"], found["passes"]) == ("iterative", True)
    assert found["share"] == pytest.approx(1.0)
    closer = compare(store, tolerance_deg=2.2)["tolerance"]
    assert (closer["method"], closer["passes"]) == ("ls", False)
    assert closer["share"] == pytest.approx(0.5, abs=0.05)
    assert compare(store)["tolerance"] is None
    # Half a pixel in a thousand short of nine tenths is not shown, nor judged, as nine tenths.
    pixels = np.argwhere(np.isfinite(truth).all(-1))
    short = tilted(truth, 2.0)
    short[tuple(pixels[: int(0.1 * len(pixels)) + 1].T)] = np.nan
    write_normals(store, "iterative", short)
    found = compare(store, methods=["iterative"], tolerance_deg=3.0)["tolerance"]
    assert (found["share"], found["passes"]) == (0.899, False)


def test_bands_give_what_the_whole_gives(store, write_normals, monkeypatch):
    truth = some_truth()
    save_truth(store, truth)
    write_normals(store, "ls", tilted(truth, np.random.default_rng(2).exponential(4, (24, 32))))
    whole = compare(store)
    monkeypatch.setattr(module, "BAND_PIXELS", 5 * 32)
    bands = compare(store)
    assert bands["methods"]["ls"].pop("real_rotation_deg") == pytest.approx(
        whole["methods"]["ls"].pop("real_rotation_deg"), rel=1e-9
    )
    assert bands["methods"]["ls"].pop("real_median_unrotated_deg") == pytest.approx(
        whole["methods"]["ls"].pop("real_median_unrotated_deg"), rel=1e-6
    )
    assert bands == whole
