"""What each step found, as tables in natural units."""

import math
from collections.abc import Callable, Iterator
from typing import Any

from compare.report.verdict import trust_sentence
from lab.job import Job
from rgbn.light_tables import light_tables
from rgbn.text_tables import fact_table, number_table
from scene.camera import Camera


def check_tables(job: Job, summary: dict[str, Any]) -> Iterator[Any]:
    """Yield frames, brightness, clipping and the camera."""
    found = summary["capture"]
    rows = found["frames_table"]
    ambient = ", an ambient frame is subtracted" if found["ambient"] else ", no ambient frame"
    dark, *_, bright = sorted(rows, key=lambda row: row["brightness"]) * 2
    clipped = max(rows, key=lambda row: row["saturated_share"])
    most = f"{percent(clipped['saturated_share'])} of the pixels in {clipped['name']}, fewer in the others"
    yield fact_table(
        f"{summary['name']}: check",
        [
            ("frames", f"{found['frames']} of {found['width']} x {found['height']} px{ambient}"),
            (
                "brightness",
                f"{percent(dark['brightness'])} ({dark['name']}) to {percent(bright['brightness'])} "
                f"({bright['name']}) of white, mean over a frame",
            ),
            ("clipped", most if clipped["saturated_share"] else "no pixel"),
            ("camera", camera_text(job.store.load_camera())),
        ],
    )


def camera_text(camera: Camera) -> str:
    """Return focal length, field of view, and where they come from."""
    if camera.is_orthographic:
        return f"focal length not known, taken as orthographic ({camera.source})"
    across, down = (
        math.degrees(2 * math.atan(size / (2 * focal)))
        for size, focal in ((camera.width, camera.fx), (camera.height, camera.fy))
    )
    doubt = f" ± {100 * camera.focal_sigma:.2g} %" if camera.focal_sigma else ""
    source = "taken as most cameras have it" if camera.source == "assumed" else f"from {camera.source}"
    return f"focal length {camera.fx:.1f} px{doubt}, field of view {across:.1f} x {down:.1f} deg, {source}"


def percent(share: float) -> str:
    """Return a share in percent, to two digits and no fewer than its whole ones."""
    return f"{100 * share:.2g} %" if share < 0.1 else f"{100 * share:.0f} %"


def calibrate_tables(job: Job, summary: dict[str, Any]) -> Iterator[Any]:
    """Yield the lights and the balls."""
    yield from light_tables(job.store, moved="align" in job.done)


def self_test_tables(job: Job, summary: dict[str, Any]) -> Iterator[Any]:
    """Yield how far the calibration of its own rendering is off."""
    test = summary["self_test"]
    if not (test and test["calibrated"]):
        return
    rows = [("directions", f"{test['direction_error_deg_median']:.2f} deg off (median)")]
    if (position := test.get("position_error_percent_median")) is not None:
        rows.append(("positions", f"{position:.1f} % off (median)"))
    if (intensity := test.get("intensity_error_percent_rms")) is not None:
        rows.append(("intensities", f"{intensity:.1f} % off (rms)"))
    for what in ("directions", "positions", "intensities"):
        if (inside := test.get(f"{what}_inside_95")) is not None:
            rows.append(("", f"{inside:.0%} of the {what} inside their 95 % region"))
    yield fact_table("self-test", rows)


def align_tables(job: Job, summary: dict[str, Any]) -> Iterator[Any]:
    """Yield the registration, or that there is none."""
    found, session = summary["align"] or {}, job.session
    if found.get("residual_px") is None:
        known = "given normals" if session.normals else "none: the session names no scan and no normals"
        yield fact_table("align", [("ground truth", known)])
        return
    rows = [
        ("scan", session.scan.name),
        ("residual", f"{found['residual_px']:.2f} px, of the outline"),
        ("pose, sigma", f"{found['sigma_mm']:.2g} mm, {found['sigma_deg']:.2g} deg"),
        ("object", _size(found, session.scan_unit)),
    ]
    if found["distance_mm"] is not None:
        rows.append(("distance", f"{found['distance_mm']:.0f} mm from the camera"))
    if (sigma := found.get("truth_sigma_deg_median")) is not None:
        rows.append(("true normals", f"sigma {sigma:.2f} deg (median)"))
    yield fact_table("align", rows)


def _size(found: dict[str, Any], unit: str) -> str:
    """Return the object's size as registered, and in the numbers of the scan's file."""
    size, per_unit = found["size_mm"], found["mm_per_unit"]
    text = f"{' x '.join(f'{side:.1f}' for side in size)} mm, along the scan's axes"
    if unit == "mm" or not per_unit:
        return text
    file = " x ".join(f"{side / per_unit:.4g}" for side in size)
    said = "of unknown unit" if unit == "unknown" else unit
    return f"{text}; {file} {said} in the file (1 = {per_unit:.6g} mm)"


def solve_tables(job: Job, summary: dict[str, Any]) -> Iterator[Any]:
    """Yield the methods."""
    methods = summary["solve"]["methods"]
    rows = [
        (name, f"{row['seconds']:.1f}", "–" if (sigma := row["sigma_deg_median"]) is None else f"{sigma:.2f}")
        for name, row in methods.items()
    ]
    yield number_table("solve", ("method", "seconds", "sigma of a normal, deg (median)"), rows, words=1)


def trust_tables(job: Job, summary: dict[str, Any]) -> Iterator[Any]:
    """Yield how well each method predicts photographs, and what to take."""
    found = summary["trust"]
    if not found:
        return
    rows = [
        (name, "–" if (told := row["unexplained"]) is None else f"{told:.1%}", f"{row['apart_deg']:.1f}")
        for name, row in found["methods"].items()
    ]
    heads = ("method", "unexplained, of the albedo", f"from {found['recommended']}, deg (mean)")
    yield number_table("trust", heads, rows, words=1)
    yield fact_table("", [("take", trust_sentence(found))])


def twin_tables(job: Job, summary: dict[str, Any]) -> Iterator[Any]:
    """Yield the rendering, or that there is none."""
    twin = summary["twin"]
    if not twin:
        yield fact_table("twin", [("not rendered", "no scan is registered")])
        return
    rows = [
        ("material", twin["material"]["model"]),
        ("misfit", f"{percent(twin['material']['relative_rmse'])} of the photographs, rms")
        if twin["material"].get("relative_rmse") is not None
        else ("misfit", "not known"),
        *(
            [("foretold", f"{percent(held_out['relative_rmse_lit'])} of frames not fitted to, where lit")]
            if (held_out := twin.get("held_out"))
            else []
        ),
        ("rendering", f"engine {twin['engine']}, {twin['seconds']:.0f} s, error {percent(twin['error'])}"),
    ]
    yield fact_table("twin", rows)


def compare_tables(job: Job, summary: dict[str, Any]) -> Iterator[Any]:
    """Yield the errors, and against a known truth what each step is off."""
    from compare.statistics.statistics import statistics_rows

    rows = [
        (
            row["method"],
            row["frames"],
            *(f"{row[key]:.2f}" for key in ("mean_deg", "median_deg")),
            *(f"{row[key]:.0%}" for key in ("under_5_deg", "under_10_deg")),
        )
        for row in statistics_rows(summary["compare"])
    ]
    if rows:
        heads = ("method", "frames", "mean", "median", "under 5", "under 10")
        yield number_table("compare: angular error, degrees", heads, rows, words=2)
    else:
        yield fact_table("compare", [("no errors", "there is no ground truth: no scan, no given normals")])
    if check := summary.get("truth_check"):
        known = [(row["text"], f"{row['value']:.3g} {row['unit']}") for row in check.values()]
        yield number_table("against the known truth", ("figure", "value"), known, words=1)


TABLES: dict[str, Callable[[Job, dict[str, Any]], Iterator[Any]]] = {
    "check": check_tables,
    "calibrate": calibrate_tables,
    "self_test": self_test_tables,
    "align": align_tables,
    "solve": solve_tables,
    "trust": trust_tables,
    "twin": twin_tables,
    "compare": compare_tables,
}
