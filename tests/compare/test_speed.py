"""Speed against accuracy: what of a summary is charted, and why the rest is not."""

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
