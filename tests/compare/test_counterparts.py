"""Pairs of error maps whose likeness is known: how often what is not so is said, and that what is so is found."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.stats import binom

from compare.statistics import counterpart_draws
from compare.statistics.block_bootstrap import (
    draw_blocks,
    drawn_correlation,
    drawn_statistics,
    memory_of,
    structured_share,
)
from compare.statistics.counterpart_draws import Capture, Drawn
from compare.statistics.counterpart_verdict import compare_counterparts
from compare.statistics.solver_order import kendall_tau, solver_order
from scene.errors import SceneError

SIDE, DRAWS = 64, 300
PAIRS = 160


def disc(side):
    """The object's pixels."""
    v, u = np.mgrid[:side, :side] - (side - 1) / 2
    return u**2 + v**2 < (side / 2 - 2) ** 2


OBJECT = disc(SIDE)


def field(rng, scale_px, side=SIDE):
    """A map of variance 1 whose neighbours are alike over some `scale_px` pixels."""
    if scale_px == 0:
        return rng.standard_normal((side, side))
    edge = int(4 * scale_px) + 1
    wide = gaussian_filter(rng.standard_normal((side + 2 * edge,) * 2), scale_px)[edge:-edge, edge:-edge]
    return wide * 2 * np.sqrt(np.pi) * scale_px


def errors(rng, shared, *, level=2.0, scale_px=1.5):
    """One capture's errors: what shape makes of them, what is this capture's own, and noise."""
    side = len(shared)
    own = 0.35 * field(rng, scale_px, side) + 0.2 * field(rng, 0, side)
    return np.where(disc(side), level * np.exp(0.6 * shared + own), np.nan).astype(np.float32)


def captures(seed, *, levels=({}, {}), shared=(True, True), scale_px: float = 1.5, names="abc", side=SIDE):
    """Two captures of some methods, from one distribution unless told otherwise."""
    rng = np.random.default_rng(seed)
    patterns = {name: field(rng, 2.5, side) for name in names}
    other = {name: field(rng, 2.5, side) for name in names}
    usual = {"a": 2.0, "b": 2.3, "c": 6.0}
    made = []
    for level, same in zip(levels, shared, strict=True):
        at = {**usual, **level}
        source = patterns if same else other
        made.append({name: errors(rng, source[name], level=at[name], scale_px=scale_px) for name in names})
    return [Capture(name, "simulated", maps) for name, maps in zip(("real", "twin"), made, strict=True)]


@pytest.mark.full
@pytest.mark.parametrize("scale_px", [0, 1.5])
def test_pairs_of_one_distribution_are_told_apart_no_more_often_than_one_in_twenty(scale_px):
    found = [
        compare_counterparts(*captures(10000 + seed, scale_px=scale_px, names="ac", side=44), draws=100, seed=seed)
        for seed in range(PAIRS)
    ]
    # Every p is a p: neither oftener low than chance allows, nor so seldom that no difference would be found.
    p = np.array([one["level"]["p"] for one in found])
    for level in (0.05, 0.2, 0.5, 0.8):
        least, most = binom.ppf((0.0005, 0.9995), PAIRS, level)
        assert least <= np.count_nonzero(p < level) <= most
    assert sum(one["verdict"] == "differ" for one in found) <= binom.ppf(0.999, PAIRS, 0.05)
    assert sum(one["verdict"] == "alike" for one in found) > 0.85 * PAIRS


@pytest.mark.parametrize(
    ("question", "how", "least"),
    [
        ("level", {"levels": ({}, {"c": 9.5})}, 9),
        # On so small an object an interval is wide: what cannot be shown is not said.
        ("pattern", {"shared": (True, False), "scale_px": 2.5}, 6),
        ("order", {"levels": ({"a": 2.0, "b": 4.5}, {"a": 4.5, "b": 2.0})}, 9),
    ],
)
def test_what_differs_is_found_and_named(question, how, least):
    """Errors half as large again; the same errors at other places; two methods that change their places."""
    found = [compare_counterparts(*captures(30000 + seed, **how), draws=DRAWS, seed=seed) for seed in range(10)]
    assert sum(one["reasons"][question] == "differ" for one in found) >= least
    assert not any(one["verdict"] == "alike" or one["reasons"][question] == "alike" for one in found)
    if question == "order":
        assert all(one["order"]["contradictions"] in ([["a", "b"]], []) for one in found)


@pytest.mark.full
def test_an_order_that_chance_decides_is_not_called_the_same():
    """Two methods as good as each other, one far behind: their order says nothing, and is said to say nothing."""
    even = ({"a": 2.0, "b": 2.0}, {"a": 2.0, "b": 2.0})
    found = [
        compare_counterparts(*captures(40000 + seed, levels=even), draws=DRAWS, seed=seed)["order"]
        for seed in range(40)
    ]
    significant = sum(one["pairs"][0]["real"]["significant"] for one in found)
    assert significant <= binom.ppf(0.999, len(found), 0.05 / 3)
    assert not any(one["contradictions"] for one in found)
    assert all(one["pairs"][1]["real"]["significant"] and one["pairs"][1]["twin"]["significant"] for one in found)
    assert found[0]["tau_low"] < 1
    assert "not significant" in " ".join(found[0]["sentences"]["real"])


def test_uncertain_lights_turn_a_significant_order_into_an_open_one():
    real, twin = captures(50000)
    sure = compare_counterparts(real, twin, seed=1, draws=DRAWS)["order"]["pairs"][1]["real"]
    rng = np.random.default_rng(3)
    moved = {name: np.repeat(rng.normal(0, 4.0 if name == "c" else 0.1, (50, 1)), 4, 1) for name in "abc"}
    unsure = compare_counterparts(Capture("real", "simulated", real.errors, moved), twin, seed=1, draws=DRAWS)
    pair = unsure["order"]["pairs"][1]["real"]
    assert sure["significant"]
    assert not pair["significant"]
    assert pair["difference_deg"] == sure["difference_deg"]
    assert pair["sigma_deg"] == pytest.approx(np.hypot(sure["sigma_deg"], 4.0), rel=0.2)
    # What moves all methods alike moves no method past another.
    together = {name: np.repeat(np.random.default_rng(4).normal(0, 4.0, (50, 1)), 4, 1) for name in "abc"}
    shifted = compare_counterparts(Capture("real", "simulated", real.errors, together), twin, seed=1, draws=DRAWS)
    assert shifted["order"]["pairs"][1]["real"]["significant"]
    assert not shifted["methods"]["c"]["difference"]["median_deg"]["significant"]


def test_maps_of_two_sizes_are_compared_without_laying_them_over_each_other():
    real, twin = captures(60000)
    wider = {name: np.pad(error, ((0, 0), (0, 9)), constant_values=np.nan) for name, error in twin.errors.items()}
    found = compare_counterparts(real, Capture("twin", "simulated", wider), draws=DRAWS)
    assert not found["laid_over"]
    assert found["methods"]["a"]["pattern"] is None
    assert found["reasons"]["pattern"] == "not shown"
    assert found["order"]["tau"] == 1


def test_large_maps_are_thinned_alike_and_counted_whole(monkeypatch):
    """A method that answers fewer pixels than another must not be thinned by another step than it."""
    monkeypatch.setattr(counterpart_draws, "PIXELS", 800)
    real, twin = captures(61000)
    for side in (real, twin):
        side.errors["b"][:40] = np.nan
    found = compare_counterparts(real, twin, draws=DRAWS)
    assert found["laid_over"]
    for name in "abc":
        for kind, side in (("real", real), ("twin", twin)):
            row, error = found["methods"][name][kind], side.errors[name]
            assert row["pixels"] == np.isfinite(error).sum()
            assert row["median_deg"] == pytest.approx(np.nanmedian(error), rel=1e-6)
        assert found["methods"][name]["pattern"]["pixels"] == np.isfinite(real.errors[name]).sum()


def test_a_method_without_any_answer_is_left_out_and_named():
    real, twin = captures(62000)
    without = {name: np.full_like(error, np.nan) if name == "b" else error for name, error in twin.errors.items()}
    found = compare_counterparts(real, Capture("twin", "simulated", without), draws=DRAWS)
    assert found["left_out"] == ["b"]
    # The others are told as if it had never been.
    fewer = [Capture("x", "simulated", {name: side.errors[name] for name in "ac"}) for side in (real, twin)]
    assert found["methods"] == compare_counterparts(*fewer, draws=DRAWS)["methods"]
    nothing = {name: np.full_like(error, np.nan) for name, error in twin.errors.items()}
    with pytest.raises(SceneError, match=r"no method has a known error on both \(looked at: a, b, c\)"):
        compare_counterparts(real, Capture("twin", "simulated", nothing), draws=DRAWS)


def test_draws_that_miss_the_few_pixels_of_a_sparse_map_are_numbers():
    rng = np.random.default_rng(9)
    sparse = np.full((60, 60), np.nan)
    sparse[:6, :6] = rng.exponential(2.0, (6, 6))
    blocks = draw_blocks(np.ones_like(sparse, bool), 3.0, 400, rng)
    assert np.isfinite(drawn_statistics(sparse, blocks)).all()
    assert np.isfinite(drawn_correlation(sparse, sparse**2, blocks)).all()


def test_draws_of_independent_pixels_have_the_spread_of_the_mean():
    rng = np.random.default_rng(7)
    error = rng.exponential(3.0, (80, 80))
    drawn = drawn_statistics(error, draw_blocks(np.ones_like(error, bool), 1.0, 2000, rng))
    assert drawn[:, 0].std() == pytest.approx(3.0 / 80, rel=0.1)
    assert drawn.mean(0) == pytest.approx([error.mean(), *np.quantile(error, [0.5, 0.25, 0.75])], rel=0.02)


def test_memory_is_the_integral_of_the_autocorrelation():
    rng = np.random.default_rng(8)
    lengths = [memory_of(np.where(OBJECT, field(rng, 2.0), np.nan)).length_px for _ in range(30)]
    # Gaussian of standard deviation s: rho(k) = exp(-k^2 / 4 s^2), whose integral is 2 s sqrt(pi).
    assert np.mean(lengths) == pytest.approx(4 * np.sqrt(np.pi), rel=0.12)
    assert memory_of(np.where(OBJECT, field(rng, 0), np.nan)).length_px == pytest.approx(1, abs=0.5)
    assert structured_share(field(rng, 6.0)) > 0.7
    assert structured_share(field(rng, 0)) < 0.2


def test_methods_as_good_as_each_other_are_ranked_no_oftener_than_said():
    """One in twenty, whichever of the two chance favours."""
    rng, told, pairs = np.random.default_rng(11), [], 0
    for _ in range(1000):
        found = rng.normal(2.0, 0.1, (2, 2))
        sides = [
            Drawn(one, one + rng.normal(0, 0.1, (400, 2)), np.ones(2), np.zeros((400, 2)), np.full(2, 1e4))
            for one in found
        ]
        order = solver_order(("a", "b"), sides[0], sides[1])
        told += order["sentences"]["real"]
        pairs += order["pairs"][0]["real"]["significant"]
    sure = sum("not significant" not in text for text in told)
    assert sure == pairs
    assert binom.ppf(0.001, 1000, 0.05) <= sure <= binom.ppf(0.999, 1000, 0.05)


def test_kendalls_tau_of_cases_counted_by_hand():
    a = np.array([[1.0, 2.0, 3.0, 4.0]])
    assert kendall_tau(a, a) == 1
    assert kendall_tau(a, -a) == -1
    # One of six pairs is turned over.
    assert kendall_tau(a, np.array([[2.0, 1.0, 3.0, 4.0]])) == pytest.approx(4 / 6)
    assert kendall_tau(a, np.ones((1, 4))) == 0
