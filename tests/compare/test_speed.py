"""Speed against accuracy: what of a summary is charted."""

from compare.report.facts import speed_points
from draw.speed_chart import SpeedPoint


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
    assert speed_points(summary_of(ls=(0.1, 0.6, 3.0, 2.0))) == [
        SpeedPoint("ls", "calibrated", "real", 0.1, 3.0),
        SpeedPoint("ls", "calibrated", "twin", 0.6 / (0.5 * 4), 2.0),
    ]


def test_what_has_no_time_or_no_error_is_not_charted():
    summary = summary_of(
        ls=(0.1, 0.6, 3.0, 2.0), Net=(9.0, 3.0, None, 1.0), tv=(None, None, 4.0, None), hsh=(0.2, 1.0, 0.0, 1.0)
    )
    points = speed_points(summary)
    assert {(p.method, p.kind) for p in points} == {("ls", "real"), ("ls", "twin"), ("Net", "twin"), ("hsh", "twin")}
    summary["compare"] = {"has_truth": False, "methods": {name: {} for name in summary["solve"]["methods"]}}
    assert speed_points(summary) == speed_points({}) == []
