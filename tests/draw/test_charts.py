"""Charts: what is charted stands where its numbers say, each name can be read, and text stays text."""

import re
import xml.etree.ElementTree as ElementTree
from html import unescape

import numpy as np
import pytest

from draw.line_chart import line_chart
from draw.object_charts import error_histograms
from draw.speed_chart import SpeedPoint, pareto_front, speed_chart
from draw.svg import Axis, svg, text

FAMILIES = {"ls": "calibrated", "tv": "uncalibrated", "Net": "external"}


def parts(drawing):
    """Return the shapes that tell something when one points at them: (words, name, attributes)."""
    root = ElementTree.fromstring(drawing)
    space = "{http://www.w3.org/2000/svg}"
    told = ((one, one.find(f"{space}title")) for one in root.iter())
    return [(title.text, one.tag.removeprefix(space), one.attrib) for one, title in told if title is not None]


def names_of(drawing):
    """Return the places (N, 2) of the names in a chart, and the names."""
    found = re.findall(r'<text x="([\d.]+)" y="([\d.]+)"[^>]*class="name"[^>]*>([^<]*)<', drawing)
    return np.array([row[:2] for row in found], float), [unescape(name) for *_, name in found]


def some_points(seed, count=14):
    rng = np.random.default_rng(seed)
    seconds, errors = 10 ** rng.normal(size=count), 10 ** (0.4 * rng.normal(size=count) + 0.5)
    return [
        SpeedPoint(f"m{i}", "calibrated", "real", *pair) for i, pair in enumerate(zip(seconds, errors, strict=True))
    ]


@pytest.mark.parametrize("seed", range(3))
def test_the_front_is_what_nothing_beats_and_the_steps_pass_through_it(seed):
    points = some_points(seed)
    beaten = [any(q != p and q.seconds <= p.seconds and q.median_deg <= p.median_deg for q in points) for p in points]
    front = pareto_front(points)
    assert {p.method for p in front} == {p.method for p, b in zip(points, beaten, strict=True) if not b}
    a, b = SpeedPoint("a", "calibrated", "real", 1.0, 2.0), SpeedPoint("b", "calibrated", "real", 2.0, 2.0)
    assert pareto_front([b, a, a]) == [a], "of two alike the faster, and a tie once"
    drawing = speed_chart(points)
    at = {words.split(",")[0]: (float(one["cx"]), float(one["cy"])) for words, _, one in parts(drawing)}
    (path,) = re.findall(r'<path d="M([\d. L]+)" fill="none" stroke="#777" stroke-width="1.5"', drawing)[:1]
    corners = np.array([pair.split() for pair in path.split("L")], float)
    steps = np.diff(corners, axis=0)
    assert (np.minimum(*np.abs(steps).T) == 0).all(), "steps run along the axes"
    assert (steps >= 0).all(), "with more time, less error"
    for point in front:
        assert np.abs(corners - at[point.method]).sum(1).min() < 0.21
    for x, y in at.values():
        assert y <= corners[corners[:, 0] <= x + 0.11][:, 1].max() + 0.11


def test_equal_ratios_are_equal_steps_and_the_larger_error_stands_higher():
    values = [(0.1, 1.0), (1.0, 10.0), (10.0, 1.0)]
    points = [SpeedPoint(f"m{i}", "calibrated", "real", *value) for i, value in enumerate(values)]
    (x0, y0), (x1, y1), (x2, y2) = ((float(one["cx"]), float(one["cy"])) for *_, one in parts(speed_chart(points)))
    assert x1 - x0 == pytest.approx(x2 - x1, abs=0.2)
    assert x1 > x0
    assert y0 == y2 > y1


def test_families_differ_by_shape_and_the_twin_is_hollow_and_unnamed():
    points = [
        SpeedPoint(name, family, kind, 1.0 + i + 0.1 * (kind == "twin"), 2.0 + i)
        for i, (name, family) in enumerate(FAMILIES.items())
        for kind in ("real", "twin")
    ]
    drawing = speed_chart(points)
    drawn = {(words.split(":")[0], shape, one["fill"] != "white") for words, shape, one in parts(drawing)}
    shapes = {"ls": "circle", "tv": "rect", "Net": "path"}
    kinds = ("photographs", "twin")
    assert drawn == {(f"{name}, {kind}", shapes[name], kind == "photographs") for name in shapes for kind in kinds}
    assert sorted(names_of(drawing)[1]) == sorted(shapes)
    for word in ("calibrated", "uncalibrated", "external", "hollow", "Pareto front"):
        assert f">{word}" in drawing
    assert ">external" not in speed_chart(points[1:2])
    assert f">{'X' * 300}<" in speed_chart([SpeedPoint("X" * 300, "external", "real", 1.0, 2.0)])


def test_a_name_keeps_to_its_own_point_and_off_all_marks():
    places = [(1.0, 1.0), (1.2, 1.0), (30.0, 8.0)]
    points = [SpeedPoint(f"name{i}", "calibrated", "real", *place) for i, place in enumerate(places)]
    drawing = speed_chart(points)
    marks = {words.split(",")[0]: (float(one["cx"]), float(one["cy"])) for words, _, one in parts(drawing)}
    places, names = names_of(drawing)
    assert names == [*marks]
    # From the edges of a name's letters, 33 wide and 13 high, whose foot is 5 below their middle.
    away = np.maximum(np.abs(places[:, None] - [0, 5] - np.array([*marks.values()])) - [16.5, 6.5], 0)
    distance = np.linalg.norm(away, axis=-1)
    assert (distance.argmin(1) == [0, 1, 2]).all()
    assert distance.min() >= 6
    assert distance.diagonal().max() < 20


@pytest.mark.parametrize("spread", [0.0, 0.1, 1.0])
def test_names_are_apart_even_where_all_points_are_one_and_stay_text(spread):
    rng = np.random.default_rng(10_130)
    names = [*(f"semicalibrated{i}" for i in range(12)), "<b>&x"]
    points = [
        SpeedPoint(name, "calibrated", kind, *(10 ** (spread * rng.uniform(size=2))))
        for name in names
        for kind in ("real", "twin")
    ]
    drawing = speed_chart(points)
    middles, found = names_of(drawing)
    assert set(found) == set(names)
    # A sans-serif letter is about half as wide as high.
    sizes = np.array([[6.5 * len(name), 13] for name in found])
    apart = np.abs(middles[:, None] - middles) >= (sizes[:, None] + sizes) / 2
    assert (apart.any(-1) | np.eye(len(found), dtype=bool)).all()
    assert (middles >= 0).all()
    assert (middles <= [760, 470]).all()
    assert "<b>" not in drawing


def test_a_histogram_has_each_bins_height():
    compared = {
        "histogram_edges_deg": [0.0, 2.0, 5.0],
        "methods": {"<ls>": {"histogram": {"real": [1, 2, 1]}}, "tv": {}},
    }
    drawing = error_histograms(compared, ["<ls>", "tv"])
    (path,) = re.findall(r'<path d="M([^"]*)" fill="#56B4E9"', drawing)
    x, y = np.array([pair.split() for pair in path.split("L")], float).T
    base, first, second = y[0], y[1], y[3]
    assert base - second == pytest.approx(2 * (base - first), abs=0.2)
    assert (x[2] - x[0]) / (x[-1] - x[0]) == pytest.approx(2 / 5, abs=0.01)
    assert "&lt;ls&gt;" in drawing
    assert "real beyond: 25.0 %" in drawing
    assert error_histograms(compared, ["tv"]) is None
    label = "drawing: Histogram of the angular error of each method; filled: photographs, line: twin"
    assert (repr(drawing), drawing._repr_svg_()) == (label, str(drawing))


def test_axes_span_the_data_with_round_ticks_and_what_is_unknown_is_no_point():
    axis = Axis.over([[0.3, 7.2], [np.nan]], 0, 100, log=False)
    assert (axis.at(0), [tick for tick, _ in axis.ticks]) == (0, [0, 2, 4, 6])
    axis = Axis.over([[0.1, 10]], 0, 100, log=True)
    assert axis.at(1) == pytest.approx(50)
    drawing = line_chart({"a & b": ([1, 2, 3], [1, np.nan, 3])}, x_title="x", y_title="y", spreads={})
    assert "nan" not in drawing
    assert "a &amp; b" in drawing


def test_text_stays_text_wherever_it_goes():
    evil = '"><script>evil()</script>'
    drawing = svg(10, 10, [text(1, 1, evil, font_weight=evil)], label=evil)
    assert "<script>" not in drawing
    assert ElementTree.fromstring(drawing).attrib["aria-label"] == evil


def test_a_long_name_stays_in_the_picture():
    """`iterative, photographs` was cut off at the right border."""
    name = "iterative, photographs"
    for names in ([name], ["a", "W" * 40]):
        root = ElementTree.fromstring(line_chart({one: ([1, 2], [1, 2]) for one in names}, x_title="x", y_title="y"))
        width = float(root.attrib["viewBox"].split()[2])
        for shown in (one for one in root.iter() if one.text in names):
            assert float(shown.attrib["x"]) + 6.3 * len(shown.text) < width, "13 px of a usual font"
