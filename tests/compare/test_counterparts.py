"""Error maps whose likeness is known: what one interval holds, which methods are level, and what is called alike."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from compare.statistics.counterparts import compare_counterparts, difference, drawn_medians, level_methods, thinned
from scene.errors import SceneError

SIDE = 64
V, U = np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2
OBJECT = V**2 + U**2 < (SIDE / 2 - 2) ** 2


def field(rng, scale_px):
    """A map of variance 1 whose neighbours are alike over some `scale_px` pixels."""
    wide = gaussian_filter(rng.standard_normal((SIDE + 40,) * 2), scale_px)[20:-20, 20:-20]
    return wide * 2 * np.sqrt(np.pi) * scale_px


def errors(rng, shared, level=2.0):
    """One capture's errors: what shape makes of them, what is this capture's own, and noise."""
    own = 0.2 * field(rng, 1.5) + 0.15 * rng.standard_normal((SIDE, SIDE))
    return np.where(OBJECT, level * np.exp(0.6 * shared + own), np.nan).astype(np.float32)


def pair(seed, *, level=2.0, same=True):
    rng = np.random.default_rng(seed)
    shared = field(rng, 2.5)
    return errors(rng, shared), errors(rng, shared if same else field(rng, 2.5), level)


def test_the_interval_holds_no_difference_where_there_is_none_and_not_where_there_is_one():
    found = [difference(*pair(seed)) for seed in range(20)]
    assert sum(row["median_difference_low_deg"] < 0 < row["median_difference_high_deg"] for row in found) >= 16
    for seed in range(6):
        row = difference(*pair(seed, level=2.8))
        assert row["median_difference_low_deg"] < row["median_difference_deg"] < row["median_difference_high_deg"] < 0


def test_maps_are_called_alike_by_their_places_and_told_with_their_sizes():
    for seed in range(6):
        a, b = pair(seed)
        apart, _ = pair(100 + seed)
        found = compare_counterparts({"x": a, "y": a + 1, "z": a + 2}, {"x": b, "y": apart + 1, "z": 9 * b})
        rows = found["methods"]
        assert {name: row["likeness"] for name, row in rows.items()} == {"x": "alike", "y": "not alike", "z": "alike"}
        assert (found["verdict"], found["laid_over"], found["left_out"]) == ("alike", True, [])
        assert rows["z"]["real"]["median_deg"] == pytest.approx(2 + np.nanmedian(a), rel=1e-6)
        assert list(rows) == ["x", "y", "z"]


def test_captures_of_two_sizes_are_compared_without_laying_them_over_each_other():
    real, twin = pair(7, level=4.0)
    wider = np.pad(twin, ((0, 0), (0, 9)), constant_values=np.nan)
    found = compare_counterparts({"a": real}, {"a": wider})
    row = found["methods"]["a"]
    assert (found["laid_over"], row["pearson"], row["likeness"]) == (False, None, "not known")
    assert row["median_difference_deg"] == pytest.approx(np.nanmedian(real) - np.nanmedian(twin), rel=1e-6)
    assert row["median_difference_high_deg"] < 0


def test_a_method_without_any_answer_is_left_out_and_named():
    real, twin = pair(8)
    nothing = np.full_like(twin, np.nan)
    found = compare_counterparts({"a": real, "b": real}, {"a": twin, "b": nothing})
    assert found["left_out"] == ["b"]
    assert found["methods"] == compare_counterparts({"a": real}, {"a": twin})["methods"]
    with pytest.raises(SceneError, match=r"no method has a known error on both \(looked at: a\)"):
        compare_counterparts({"a": real}, {"a": nothing})
    assert difference(real, nothing)["median_difference_low_deg"] is None


def test_draws_of_independent_pixels_have_the_spread_of_maps_drawn_anew():
    rng = np.random.default_rng(6)
    maps = rng.gamma(4.0, 0.5, (60, 50, 50))
    told = np.mean([drawn_medians([each]).std() for each in maps[:12]])
    assert told == pytest.approx(np.median(maps, axis=(1, 2)).std(), rel=0.3)
    sparse = np.full((60, 60), np.nan)
    sparse[:6, :6] = rng.exponential(2.0, (6, 6))
    # Beside a whole map most draws miss a sparse one's few blocks.
    assert np.isfinite(drawn_medians([sparse, np.ones((60, 60)), maps[0][:60]][:2])).all()
    assert thinned(np.zeros((1200, 900))).size <= 200_000


def test_methods_are_level_when_the_truth_or_the_pixels_do_not_tell_them_apart():
    rng = np.random.default_rng(5)
    noise = rng.gamma(4.0, 0.5, (90, 90))
    maps = {"a": noise, "b": noise + 0.3, "c": noise + 0.9}
    # Squares of the medians, 1.84, 2.14 and 2.74 degrees, differ by 1.2 and 4.1; 2 sigma^2 is 1.6.
    found = level_methods(maps, 0.9)
    assert (found["best"], found["level"]) == ("a", ["b"])
    # A shift common to all pixels is certain by the draws, since both methods have the same blocks.
    assert level_methods(maps, None)["level"] == []
    level = [level_methods({k: rng.gamma(4, 0.5, (60, 60)) for k in "ab"}, None)["level"] != [] for _ in range(20)]
    assert sum(level) >= 17
    apart = {"a": rng.gamma(4, 0.5, (60, 60)), "b": rng.gamma(4, 0.6, (60, 60))}
    assert level_methods(apart, None)["level"] == []
    assert level_methods({"a": np.full((9, 9), np.nan)}, 1.0) == {"best": None, "median_sigma_deg": {}, "level": []}
