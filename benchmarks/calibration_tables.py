"""The tables and charts of docs/evidence/calibration.md, from what the benchmark's rows measured."""

from pathlib import Path

import numpy as np

from benchmarks.calibration_peers import FOCAL_PX, OFF_AXIS_MM
from benchmarks.pages import folded
from compare.report.line_chart import line_chart

TOOLS = {
    "psbox": "PSBox, select-ball",
    "meshroom": "Meshroom",
    "relightlab": "RelightLab",
    "ours": "rgbn",
}
EMPTY = "not run"


def tables(results: dict[str, dict]) -> dict[str, str]:
    """Return the markdown between each pair of markers."""
    return {"reach": _reach(results), "peers": _peers(results), "balls": _balls(results)}


def _of(results: dict, row: str, key: str, of, form: str) -> str:
    values = results.get(row, {}).get(key)
    return form.format(of(np.abs(np.array(values, float)))) if values else EMPTY


def _median_p95(results: dict, row: str, key: str, unit: str) -> str:
    values = np.abs(np.array(results.get(row, {}).get(key, []), float))
    return f"{np.nanmedian(values):.3f} / {_p95(values):.3f}{unit}" if len(values) else EMPTY


def _p95(values) -> float:
    return float(np.nanquantile(values, 0.95))


def _rms(values) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _reach(results: dict) -> str:
    rows = [
        (
            "direction at the object, two chrome balls of 67 px, near flash: median / p95",
            "0.20 / 0.5°",
            "0.10 / 0.3°",
            _median_p95(results, "two", "direction_deg", "°"),
        ),
        (
            "direction at the ball, one ball of 170 px: median / p95",
            "0.15° median",
            "0.05°",
            _median_p95(results, "one", "direction_deg", "°"),
        ),
        (
            "light position, four balls, of its range: median / p95",
            "1 % median",
            "0.5 %",
            _median_p95(results, "four", "position_percent", " %"),
        ),
        (
            "... two balls",
            "",
            "",
            _median_p95(results, "two", "position_percent", " %"),
        ),
        (
            "intensity at the object, per channel, two balls: rms",
            "1 %",
            "0.3 %",
            _of(results, "two", "intensity_percent", _rms, "{:.2f} %"),
        ),
        (
            "ambient, of the white ball's peak: median / p95",
            "0.5 %",
            "0.1 %",
            _median_p95(results, "two", "ambient_percent", " %"),
        ),
        (
            "direction, distant flash, two balls: median / p95",
            "",
            "",
            _median_p95(results, "far", "direction_deg", "°"),
        ),
    ]
    for name, key in (("directions", "direction_inside"), ("positions", "position_inside")):
        inside = [_of(results, row, key, np.mean, "{:.0%}") for row in ("two", "four")]
        rows.append((f"sigma honest: {name} inside 95 %, two / four balls", "90–98 %", "", " / ".join(inside)))
    rows.append(
        (
            "... directions, one ball / distant flash",
            "90–98 %",
            "",
            " / ".join(_of(results, row, "direction_inside", np.mean, "{:.0%}") for row in ("one", "far")),
        )
    )
    inside = [_of(results, row, "intensity_inside", np.mean, "{:.0%}") for row in ("two", "four")]
    rows.append(("... intensities, two / four balls", "90–98 %", "", " / ".join(inside)))
    rows.append(_speed(results))
    balls = results.get("balls")
    told, scenes = EMPTY, 200
    if balls:
        scenes = len(balls["wanted"])
        told = f"{sum(balls['found']) / sum(balls['wanted']):.1%}, {sum(balls['false'])} false"
    rows.append((f"balls found, {scenes} random scenes", "99 %, no false ball", "100 %", told))
    head = "| | bar | stretch | measured |\n|---|---|---|---|\n"
    return head + "".join("| " + " | ".join(row) + " |\n" for row in rows) + "\n" + _counts(results)


def _speed(results: dict) -> tuple[str, str, str, str]:
    speed, told, label = results.get("speed"), EMPTY, "60 x 24 MP"
    if speed:
        label = f"{speed['frames']} x {speed['megapixels']:.0f} MP"
        told = (
            f"{speed['seconds']:.0f} s against {speed['decode_s']:.0f} s: {speed['seconds'] / speed['decode_s']:.2f}; "
            f"{speed['private_gb']:.1f} GB"
        )
    return f"{label}, calibration without decode, two cores, against LibRaw's decode", "1", "0.5", told


def _counts(results: dict) -> str:
    """Say how many lights stand behind the figures, and which sessions were refused or doubted."""
    lines = []
    for row in ("two", "four", "one", "far"):
        if row in results:
            data = results[row]
            lines.append(
                f"`{row}`: {len(data['refused'])} sessions, {len(data.get('direction_deg', []))} lights, "
                f"{sum(data['refused']):.0f} refused, {sum(data.get('warned', [])):.0f} with warnings"
            )
    commits = sorted({row["commit"] for row in results.values()})
    return "; ".join(lines) + f". Measured at {', '.join(commits)}.\n" if lines else ""


def _peers(results: dict) -> str:
    data = results.get("peers")
    if not data:
        return EMPTY + "\n"
    lines = ["| ball off the axis | " + " | ".join(TOOLS.values()) + " |", "|---|" + "---|" * len(TOOLS)]
    for offset in OFF_AXIS_MM:
        cells = []
        for tool in TOOLS:
            errors = np.array(data[f"{offset:.0f}_{tool}"], float)
            lost = f", {np.isnan(errors).mean():.0%} lost" if np.isnan(errors).any() else ""
            digits = 2 if np.nanmean(errors) > 0.1 else 3
            cells.append(f"{np.nanmean(errors):.{digits}f} / {np.nanquantile(errors, 0.95):.{digits}f}{lost}")
        angle = np.degrees(np.arctan(offset / 1000))
        lines.append(f"| {angle:.1f}° ({offset / 1000 * FOCAL_PX:.0f} px) | " + " | ".join(cells) + " |")
    out = "\n".join(lines) + "\n\nMean / 95th percentile, degrees.\n\n"
    two = results.get("two", {})
    rows = [("", *TOOLS.values(), "white ball, distant")]
    direction = [data[tool] for tool in list(TOOLS)[:3]] + [two.get("direction_deg", [])]
    told = [f"{np.nanmedian(v):.2f} / {np.nanquantile(v, 0.95):.2f}" if len(v) else EMPTY for v in direction]
    rows.append(("direction at the object, degrees, median / p95", *told, "–"))
    position = [data["relightlab_position"], two.get("position_percent", [])]
    told = [f"{np.nanmedian(v):.2f} / {np.nanquantile(v, 0.95):.2f}" if len(v) else EMPTY for v in position]
    rows.append(("position, % of range, median / p95", "–", "–", *told, "–"))
    white, here = _rms(np.array(data["white_at_object"])), _of(results, "two", "intensity_percent", _rms, "{:.2f}")
    rows.append(("intensity at the object, % rms", "–", "–", "–", here, f"{white:.2f}"))
    white = _rms(np.array(data["white_at_ball"]))
    rows.append(("intensity at the white ball, % rms", "–", "–", "–", "", f"{white:.2f}"))
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return out + "\n".join([lines[0], "|---|" + "---|" * (len(rows[0]) - 1), *lines[1:]]) + "\n"


def _balls(results: dict) -> str:
    data = results.get("balls")
    if not data:
        return EMPTY + "\n"
    lines = [
        f"{sum(data['wanted'])} balls to be found in {len(data['wanted'])} scenes: {sum(data['found'])} found, "
        f"{sum(data['false'])} false; {np.median(data['seconds']):.1f} s a scene (median, one core).",
        "",
        *folded(
            "Each ball that was missed, and each false one",
            sorted(data["said"], key=lambda line: int(line.split()[1][:-1])),
        ),
    ]
    return "\n".join(lines) + "\n"


def draw_charts(results: dict, folder: Path) -> None:
    """Write the charts beside the page: errors' distribution with two balls, and mean errors off the axis."""
    peers, two = results.get("peers"), results.get("two")
    if not peers:
        return
    off = {
        name: (
            [float(np.degrees(np.arctan(offset / 1000))) for offset in OFF_AXIS_MM],
            [max(float(np.nanmean(peers[f"{offset:.0f}_{tool}"])), 1e-3) for offset in OFF_AXIS_MM],
        )
        for tool, name in TOOLS.items()
    }
    text = line_chart(off, x_title="ball off the axis, degrees", y_title="mean error of the direction, °", log_y=True)
    (folder / "calibration-off-axis.svg").write_text(text)
    if two:
        errors = {tool: peers[tool] for tool in list(TOOLS)[:3]} | {"ours": two["direction_deg"]}
        share = np.linspace(2, 100, 50)
        lines = {
            TOOLS[tool]: (np.nanpercentile(values, share).tolist(), share.tolist()) for tool, values in errors.items()
        }
        text = line_chart(
            lines, x_title="error of the direction at the object, degrees", y_title="% of the lights below", log_x=True
        )
        (folder / "calibration-two-balls.svg").write_text(text)
