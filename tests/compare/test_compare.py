"""The comparison on maps whose errors are known by construction."""

import json

import numpy as np
import pytest

import compare.compare as module
from compare.compare import _without_common_rotation, compare
from compare.statistics.statistics import ALBEDO, statistics_rows
from scene.files import write_npy
from scene.normals import unit
from scene.pose import rotation_from_vector
from scene.store import Store

V, U = np.mgrid[0:24, 0:32]
TRUTH = unit(np.stack([(U - 16) / 32, -(V - 12) / 24, np.full(V.shape, 0.6)], -1))


def tilted(degrees):
    """Return normals exactly `degrees` (a number, or one a pixel) from the truth, each in a direction of its own."""
    rng = np.random.default_rng(8)
    side = unit(np.cross(TRUTH, rng.normal(0, 1, TRUTH.shape)))
    angle = np.radians(np.broadcast_to(degrees, TRUTH.shape[:2]))[..., None]
    return np.cos(angle) * TRUTH + np.sin(angle) * side


@pytest.fixture
def compared(tmp_path):
    """Return what compares methods' normals, on the photographs and on the twin, and its store."""
    store = Store(tmp_path / "out")

    def run(real, twin=None, *, has_truth=True, mask=None, **how):
        if has_truth:
            store.save_truth(TRUTH, np.full(TRUTH.shape[:2], 0.3))
            store.save_mask(np.ones(TRUTH.shape[:2], bool) if mask is None else mask)
        for place, maps in (("normals", real), ("twin/normals", twin or {})):
            for name, normals in maps.items():
                write_npy(store.path(place, f"{name}.npy"), normals.astype(np.float32))
        return compare(store, **how)

    run.store = store
    return run


def test_every_error_is_the_one_that_was_put_in(compared):
    degrees = np.repeat([[1.0], [2.0], [7.0], [12.0]], 6, 0) * np.ones((24, 32))
    result = compared({"ls": tilted(degrees)})
    real = result["methods"]["ls"]["real"]
    assert real["min_deg"] == pytest.approx(1, abs=1e-4)
    assert real["max_deg"] == pytest.approx(12, abs=1e-4)
    assert real["mean_deg"] == pytest.approx(5.5, abs=1e-4)
    assert real["median_deg"] == pytest.approx(4.5, abs=1e-4)
    assert (real["under_5_deg"], real["under_10_deg"], real["pixels"]) == (0.5, 0.75, 24 * 32)
    assert result["methods"]["ls"]["twin"] is None
    assert result["methods"]["ls"]["coverage"] == 1
    sigma = pytest.approx(0.3)
    assert result["truth"] == {"pixels": 768, "sigma_deg_median": sigma, "sigma_deg_q3": sigma}
    np.testing.assert_allclose(np.load(compared.store.path("compare", "error_real_ls.npy")), degrees, atol=1e-4)
    # 95 % of the errors are up to 12: the next round end of scale is 15.
    assert result["error_scale_deg"] == 15
    assert sum(result["methods"]["ls"]["histogram"]["real"]) == 768
    json.dumps(result, allow_nan=False)


def test_what_lies_outside_the_mask_counts_for_nothing(compared):
    mask = np.zeros((24, 32), bool)
    mask[5:15, 6:20] = True
    first = compared({"ls": tilted(3.0), "hsh": tilted(3.0)}, mask=mask)
    garbage = np.where(mask[..., None], tilted(3.0), np.random.default_rng(0).normal(0, 1, (24, 32, 3)))
    assert compared({"ls": garbage}, mask=mask) == first
    assert first["methods"]["ls"]["real"]["pixels"] == 140 == first["mask_pixels"]
    assert np.isnan(np.load(compared.store.path("compare", "error_real_ls.npy"))[~mask]).all()


def test_real_and_twin_are_not_confused_and_one_map_twice_fails_exactly_alike(compared):
    estimate = tilted(np.random.default_rng(6).exponential(4, (24, 32)))
    real, twin = (tilted(np.linspace(*ends, 768).reshape(24, 32)) for ends in ((5, 7), (1, 3)))
    rows = compared({"ls": estimate, "hsh": real}, {"ls": estimate, "hsh": twin})["methods"]
    row = rows["ls"]
    assert (row["pearson"], row["spearman"]) == pytest.approx((1, 1))
    assert (row["median_difference_deg"], row["correlation_pixels"]) == (0, 768)
    assert row["real"] == row["twin"]
    row = rows["hsh"]
    medians = row["real"]["median_deg"], row["twin"]["median_deg"], row["median_difference_deg"]
    assert medians == pytest.approx((6, 2, 4), abs=1e-3)


def test_the_albedo_s_error_is_told_of_the_twin_within_the_mask(compared):
    albedo, twin = np.full((24, 32, 3), [0.5, 0.4, 0.2], np.float32), Store(compared.store.path("twin"))
    off = np.where(np.arange(32) < 5, 1.2, 1.0)[:, None] * [3.0, 1.0, 0.5]
    write_npy(twin.path("truth_albedo.npy"), albedo)
    write_npy(twin.path("albedo", "ls.npy"), np.where(np.arange(32)[:, None] < 20, off * albedo, 9.0))
    real, found = statistics_rows(compared({"ls": TRUTH}, {"ls": TRUTH}, mask=U < 20))
    assert [real[key] for key in ALBEDO] == [None] * 5
    # A quarter of the object is a fifth too bright.
    assert [found[key] for key in ALBEDO] == pytest.approx([0, 20, 5, 0, np.sqrt(75)], abs=1e-3)


def test_a_tilt_common_to_all_normals_is_told_apart_from_scatter(compared):
    turn = rotation_from_vector(np.radians([2.0, -3.0, 1.0]))
    methods = compared({"ls": TRUTH @ turn.T, "hsh": tilted(4.0)})["methods"]
    assert methods["ls"]["real_rotation_deg"] == pytest.approx(np.sqrt(14), abs=1e-3)
    assert methods["ls"]["real_median_unrotated_deg"] < 1e-3
    assert methods["hsh"]["real_rotation_deg"] < 1
    assert methods["hsh"]["real_median_unrotated_deg"] > 3
    # Normals that all but share one direction do not show a turn about it.
    flat = np.broadcast_to(np.float32([0, 0, 1]), (24, 32, 3))
    assert _without_common_rotation(flat, flat, np.zeros((24, 32), np.float32)) == (None, None)


def test_without_truth_only_differences_are_told_and_no_error(compared):
    result = compared({"ls": TRUTH, "iterative": tilted(6.0)}, has_truth=False)
    assert not result["has_truth"]
    assert all(row["real"] is row["twin"] is None for row in result["methods"].values())
    (pair,) = result["between_methods"]
    assert (pair["a"], pair["b"]) == ("ls", "iterative")
    assert pair["median_deg"] == pytest.approx(6, abs=1e-3)
    assert all(row["median_to_others_deg"] == pair["median_deg"] for row in result["methods"].values())
    assert any("no ground truth" in text and "not accuracy" in text for text in result["notes"])
    # The step that should have made the truth warns of it; said twice, one fact would look like two.
    assert result["warnings"] == []
    assert not list(compared.store.path("compare").glob("*"))


def test_an_unanswered_half_shows_as_coverage_and_a_method_without_answers_is_named(compared):
    half = np.where(V[..., None] < 12, np.nan, TRUTH)
    result = compared({"ls": half, "tv": np.full_like(TRUTH, np.nan)})
    assert result["methods"]["ls"]["coverage"] == 0.5
    assert result["methods"]["tv"]["real"] is None
    assert any("tv (real): no pixel" in text for text in result["warnings"])


def test_a_tolerance_counts_what_is_not_answered_as_outside(compared):
    maps = {"ls": np.where(U[..., None] < 16, np.nan, tilted(2.0)), "iterative": tilted(2.5)}
    found = compared(maps, tolerance_deg=3.0)["tolerance"]
    assert (found["method"], found["passes"]) == ("iterative", True)
    assert found["share"] == pytest.approx(1.0)
    closer = compared(maps, tolerance_deg=2.2)["tolerance"]
    assert (closer["method"], closer["passes"]) == ("ls", False)
    assert closer["share"] == pytest.approx(0.5, abs=0.05)
    assert compared(maps)["tolerance"] is None
    # Half a pixel in a thousand short of nine tenths is not shown, nor judged, as nine tenths.
    short = np.where((32 * V + U)[..., None] <= 76, np.nan, tilted(2.0))
    found = compared({"iterative": short}, methods=["iterative"], tolerance_deg=3.0)["tolerance"]
    assert (found["share"], found["passes"]) == (0.899, False)


def test_bands_give_what_the_whole_gives(compared, monkeypatch):
    maps = {"ls": tilted(np.random.default_rng(2).exponential(4, (24, 32)))}
    whole = compared(maps)
    monkeypatch.setattr(module, "BAND_PIXELS", 5 * 32)
    bands = compared(maps)
    for name, precision in (("real_rotation_deg", 1e-9), ("real_median_unrotated_deg", 1e-6)):
        one, other = (result["methods"]["ls"].pop(name) for result in (bands, whole))
        assert one == pytest.approx(other, rel=precision)
    assert bands == whole
