"""The chart of the rendering engines on the report."""

import re

import numpy as np

from compare.report.twin_section import engine_chart

FACTS = {
    "error": 0.01,
    "time_and_error": {
        "direct": [[0.05, 1.0], [0.041, 2.0], [0.04, 4.0]],
        "many": [[0.04, 2.0], [0.01, 5.0]],
        "mitsuba": [[0.04, 20.0], [0.01, 320.0]],
    },
}


def test_each_engine_is_a_line_whose_points_lie_where_its_time_and_error_are():
    chart = engine_chart(FACTS)
    lines = [
        np.array([point.split(",") for point in points.split()], float)
        for points in re.findall(r'<polyline points="([^"]+)"', chart)
    ]
    assert [len(line) for line in lines] == [3, 2, 2]
    assert all(name in chart for name in ("direct", "many", "mitsuba", "1.0"))
    x, y = np.concatenate(lines).T
    errors, seconds = np.concatenate([FACTS["time_and_error"][name] for name in ("direct", "many", "mitsuba")]).T
    assert (np.argsort(x, kind="stable") == np.argsort(errors, kind="stable")).all(), "more to the right"
    assert (np.argsort(-y, kind="stable") == np.argsort(seconds, kind="stable")).all(), "more is higher up"


def test_without_a_pilot_there_is_no_chart():
    assert engine_chart({}) == engine_chart({"time_and_error": None, "error": 0.01}) == ""
