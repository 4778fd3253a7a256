"""Speed against accuracy: what is charted, where it stands, and that each name can be read."""

import re
from html import unescape

import numpy as np
import pytest

from compare.report.facts import family
from compare.report.speed_chart import SpeedPoint, pareto_front, place_labels, speed_chart, speed_points

FRAME = (0.0, 0.0, 700.0, 360.0)


def some_points(rng, count=14, *, spread=1.0):
    seconds, errors = 10 ** (spread * rng.normal(size=count)), 10 ** (0.4 * spread * rng.normal(size=count) + 0.5)
    return [
        SpeedPoint(f"m{i}", "calibrated", "real", *pair) for i, pair in enumerate(zip(seconds, errors, strict=True))
    ]


def overlaps(middles, sizes):
    apart = np.abs(middles[:, None] - middles) >= (sizes[:, None] + sizes) / 2 - 1e-9
    return (~apart.any(-1)).sum() - len(middles)


@pytest.mark.parametrize("spread", [0.0, 3.0, 30.0, 200.0])
def test_no_name_lies_on_another_even_where_all_points_are_one(spread):
    rng = np.random.default_rng(10_101)
    points = np.clip([350, 180] + spread * rng.normal(size=(16, 2)), 5, [695, 355])
    sizes = np.stack([rng.uniform(20, 110, 16), np.full(16, 16.0)], -1)
    middles = place_labels(points, sizes, FRAME, marks=points, mark_radius=6)
    assert overlaps(middles, sizes) == 0
    assert (middles - sizes / 2 >= [0, 0]).all()
    assert (middles + sizes / 2 <= [700, 360]).all()


def test_a_name_keeps_to_its_own_point_and_off_all_marks():
    points = np.array([[100, 100], [140, 100], [400, 300]])
    sizes = np.full((3, 2), [30.0, 16.0])
    middles = place_labels(points, sizes, FRAME, marks=points, mark_radius=6)
    away = np.maximum(np.abs(middles[:, None] - points) - sizes[:, None] / 2, 0)
    distance = np.linalg.norm(away, axis=-1)
    assert (distance.argmin(1) == [0, 1, 2]).all()
    assert distance.min() >= 6


def test_a_name_beside_the_frames_corner_stays_inside():
    (middle,) = place_labels([[699, 1]], [[80, 16]], FRAME, marks=[[699, 1]], mark_radius=6)
    assert middle[0] + 40 <= 700
    assert middle[1] - 8 >= 0


def summary_of(**methods):
    """Return a summary of methods given as (seconds a megapixel-image, twin's seconds, median, twin's median)."""
    solve, compare = {}, {}
    for name, (seconds, twin_seconds, median, twin) in methods.items():
        solve[name] = {
            "processor_seconds_per_megapixel_image": seconds,
            "twin_processor_seconds": twin_seconds,
        }
        solve[name] |= {"megapixels": 0.5, "frames": 4}
        compare[name] = {
            "real": None if median is None else {"median_deg": median},
            "twin": None if twin is None else {"median_deg": twin},
        }
    return {"solve": {"methods": solve}, "compare": {"has_truth": True, "methods": compare}}


def test_the_twin_has_its_own_error_and_the_time_of_its_own_solve():
    points, missing = speed_points(summary_of(ls=(0.1, 0.6, 3.0, 2.0)))
    assert points == [
        SpeedPoint("ls", "calibrated", "real", 0.1, 3.0),
        SpeedPoint("ls", "calibrated", "twin", 0.6 / (0.5 * 4), 2.0),
    ]
    assert missing == []


def test_no_method_is_dropped_each_is_a_point_or_has_a_reason():
    summary = summary_of(
        ls=(0.1, 0.6, 3.0, 2.0), Net=(9.0, 3.0, None, 1.0), tv=(None, None, 4.0, None), hsh=(0.2, 1.0, 0.0, 1.0)
    )
    points, missing = speed_points(summary)
    assert {(p.method, p.kind) for p in points} == {("ls", "real"), ("ls", "twin"), ("Net", "twin"), ("hsh", "twin")}
    reasons = {method: [text for name, text in missing if name == method] for method, _ in missing}
    assert reasons["Net"] == ["no normal where the truth is known"]
    assert reasons["tv"] == ["no time is in the summary", "no normal on the twin where the truth is known"]
    assert "zero" in reasons["hsh"][0]
    summary["compare"] = {"has_truth": False, "methods": {name: {} for name in summary["solve"]["methods"]}}
    points, missing = speed_points(summary)
    assert points == []
    assert {text for _, text in missing} == {"there is no ground truth to tell an error"}
    assert [name for name, _ in missing] == ["ls", "Net", "tv", "hsh"]
    assert speed_points({}) == ([], [])


@pytest.mark.parametrize("seed", range(10_110, 10_115))
def test_the_front_is_what_nothing_beats(seed):
    points = some_points(np.random.default_rng(seed))
    beaten = [any(q != p and q.seconds <= p.seconds and q.median_deg <= p.median_deg for q in points) for p in points]
    front = pareto_front(points)
    assert {p.method for p in front} == {p.method for p, b in zip(points, beaten, strict=True) if not b}
    assert [p.seconds for p in front] == sorted(p.seconds for p in front)


def test_of_two_alike_the_faster_is_on_the_front_and_a_tie_is_there_once():
    a, b = SpeedPoint("a", "calibrated", "real", 1.0, 2.0), SpeedPoint("b", "calibrated", "real", 2.0, 2.0)
    assert pareto_front([b, a]) == [a]
    assert len(pareto_front([a, a])) == 1


def marks(svg):
    """Return what is drawn: (title, shape, middle, is filled) of each mark of a method."""
    out = []
    for title, shape in re.findall(r'<g class="\w+ \w+"><title>(.*?)</title>(<.*?/>)</g>', svg):
        numbers = dict(re.findall(r'(\w+)="(-?[\d.]+)"', shape))
        if shape.startswith("<circle"):
            middle = float(numbers["cx"]), float(numbers["cy"])
        elif shape.startswith("<rect"):
            middle = tuple(float(numbers[a]) + float(numbers[s]) / 2 for a, s in (("x", "width"), ("y", "height")))
        else:
            corners = np.array(re.findall(r"(-?[\d.]+),(-?[\d.]+)", shape), float)
            middle = corners[0, 0], (corners[:, 1].min() + corners[:, 1].max()) / 2
        out.append((unescape(title), shape[1 : shape.index(" ")], middle, 'fill="white"' not in shape))
    return out


def test_faster_stands_left_more_accurate_low_and_equal_ratios_are_equal_steps():
    values = [(0.1, 1.0), (1.0, 10.0), (10.0, 1.0)]
    points = [SpeedPoint(f"m{i}", "calibrated", "real", *value) for i, value in enumerate(values)]
    (x0, y0), (x1, y1), (x2, y2) = (middle for _, _, middle, _ in marks(speed_chart(points)))
    assert x0 < x1 < x2
    assert x1 - x0 == pytest.approx(x2 - x1, abs=0.2)
    assert y0 == y2 > y1, "y runs down in a drawing: the larger error stands higher"


def test_families_differ_by_shape_and_the_twin_is_hollow_and_unnamed():
    names = ("ls", "tv", "Net")
    points = [
        SpeedPoint(name, family(name), kind, 1.0 + i + 0.1 * (kind == "twin"), 2.0 + i)
        for i, name in enumerate(names)
        for kind in ("real", "twin")
    ]
    svg = speed_chart(points)
    drawn = {(title.split(":")[0], shape, filled) for title, shape, _, filled in marks(svg)}
    shapes = {"ls": "circle", "tv": "rect", "Net": "polygon"}
    assert drawn == {
        (f"{name}, {words}", shapes[name], words == "photographs")
        for name in names
        for words in ("photographs", "twin")
    }
    assert sorted(re.findall(r'<text class="name"[^>]*>([^<]*)<', svg)) == sorted(names)
    for word in ("calibrated", "uncalibrated", "external", "hollow", "Pareto front"):
        assert f">{word}" in svg
    alone = speed_chart([points[1]])
    assert re.findall(r'<text class="name"[^>]*>([^<]*)<', alone) == ["ls"]
    assert ">external" not in alone


@pytest.mark.parametrize("seed", range(10_120, 10_124))
def test_the_steps_pass_through_the_front_and_no_point_lies_below_them(seed):
    points = some_points(np.random.default_rng(seed))
    svg = speed_chart(points)
    at = {title.split(",")[0]: middle for title, _, middle, _ in marks(svg)}
    (path,) = re.findall(r'<path d="M([\d. L]+)" fill="none" stroke="#777"', svg)
    corners = np.array([pair.split() for pair in path.split("L")], float)
    steps = np.diff(corners, axis=0)
    assert (np.minimum(*np.abs(steps).T) == 0).all(), "steps run along the axes"
    assert (steps >= 0).all(), "with more time, less error"
    for point in pareto_front(points):
        assert np.abs(corners - at[point.method]).sum(1).min() < 0.11
    for x, y in at.values():
        reached = corners[corners[:, 0] <= x + 0.11][:, 1].max()
        assert y <= reached + 0.11


def test_names_are_apart_in_the_chart_itself_and_stay_text():
    rng = np.random.default_rng(10_130)
    names = [*(f"semicalibrated{i}" for i in range(12)), "<b>&x"]
    points = [
        SpeedPoint(name, "calibrated", kind, float(rng.uniform(1, 1.2)), float(rng.uniform(2, 2.2)))
        for name in names
        for kind in ("real", "twin")
    ]
    svg = speed_chart(points)
    found = re.findall(r'<text class="name" x="([\d.]+)" y="([\d.]+)"[^>]*>([^<]*)<', svg)
    assert {unescape(name) for *_, name in found} == set(names)
    places = np.array([row[:2] for row in found], float)
    # A sans-serif letter is about half as wide as high.
    sizes = np.array([[6.5 * len(unescape(name)), 13] for *_, name in found])
    assert overlaps(places, sizes) == 0
    assert "<b>" not in svg
