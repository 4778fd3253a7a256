"""The tabs of a session as rows of widgets: one for each step, with what is known there and what can be put right."""

from html import escape
from typing import Any

import numpy as np

from compare.report.facts import read_optional
from studio.photograph.outline_inputs import OutlineInputs
from studio.review.corrections import outlines_of
from studio.review.folder import is_kept
from studio.review.light_sigmas import FACTORS, fitting_factor
from studio.review.photograph_picture import OVERLAYS
from studio.review.review_window import ReviewWindow
from studio.review.scan_picking import ScanPanel
from studio.widgets import Row, plain, table, text

NONE = "(no method has run)"


def _lacks(window: ReviewWindow) -> str:
    review = window.review
    lines = [*review.lacks, *([f"- **no session**: {plain(review.why_no_session)}"] if review.why_no_session else [])]
    return "\n".join(["**Not in this folder**", "", *lines] if lines else [])


def _frame(window: ReviewWindow) -> dict[str, Any]:
    count = len(window.review.material.frames or ())
    return {"max": max(count, 2), "disabled": count < 2, "value": window.frame + 1}


def _frame_facts(window: ReviewWindow) -> str:
    review, frames = window.review, window.review.material.frames
    if frames is None:
        return "" if review.first_look is None else "The session's first photograph, as long as none is decoded here."
    facts = [f"**{plain(frames.names[window.frame])}**, {frames.width} x {frames.height} px"]
    if review.clipped_share is not None:
        facts.append(f"clipped {review.clipped_share[window.frame]:.2%} (red)")
    if review.lights is not None:
        facts += [f"**{plain(flag)}**" for flag in review.lights.flags[window.frame]]
    return ", ".join(facts)


def _overlay_note(window: ReviewWindow) -> str:
    by = "by the registered scan" if read_optional(window.review.store, "pose.json") else "as found in the photographs"
    return {
        "nothing": "",
        "mask": f"The object, {by}.",
        "scan, shaded": "The registered scan in one colour under this frame's light, without cast shadows. Where it "
        "lies right, shading and outline stay in place as the opacity changes.",
        "scan, normals": "Red: right, green: up, blue: toward the viewer.",
    }[window.shown.overlay]


def _shown(kind: str, name: str, label: str, **start: Any) -> Row:
    """Return a row for a field of `Look`."""
    return Row(kind, label, lambda window: getattr(window.shown, name),
               lambda window, value: window.show(**{name: value}), start)  # fmt: skip


CAPTURE = (
    text(_lacks),
    Row("slider", "frame", _frame, lambda window, value: window.choose(frame=int(value) - 1),
        {"min": 1, "max": 2, "step": 1, "initial_value": 1, "hint": "Or click one in the strip"}),
    text(_frame_facts),
    Row("folder", "Over the photograph", rows=(
        _shown("dropdown", "overlay", "show", options=OVERLAYS),
        _shown("slider", "opacity", "opacity", min=0.0, max=1.0, step=0.05, initial_value=0.5),
        _shown("slider", "brightness", "brightness", min=0.2, max=8.0, step=0.1, initial_value=1.0),
        _shown("checkbox", "marks_clipped", "mark clipped pixels", initial_value=True),
        text(_overlay_note),
    )),
    Row("button", "Show all of it", use=lambda window: window.choose(looks=window.looks + 1, ball=None)),
)  # fmt: skip


def balls_panel(window: ReviewWindow) -> OutlineInputs:
    """Return the panel of the balls: what was found, and corrected by hand."""
    found = lambda: window.correct(outlines_of(window.review), "balls as found")  # noqa: E731
    return OutlineInputs(window, lambda: ball_facts(window), found)


def ball_facts(window: ReviewWindow) -> str:
    """Return what is known of the chosen ball, or of all, as Markdown."""
    review, index = window.review, window.ball
    if index is None:
        if not window.outlines:
            return review.missing.get("balls", "There is no ball here.")
        moved_ones = [str(number + 1) for number, ball in enumerate(window.outlines) if ball.is_moved]
        told = f" Corrected by hand: {', '.join(moved_ones)}." if moved_ones else ""
        return f"{len(window.outlines)} balls.{told}"
    ball = window.outlines[index]
    lines = ["corrected by hand, not calibrated with yet" if ball.is_moved else "as found"]
    if index < len(review.spheres) and len(window.outlines) == len(review.spheres):
        sphere = review.spheres[index]
        lines[0] += f"; fitted: centre ± {sphere.sigma_px:.2f} px, outline seen {sphere.score:.0%}"
        if sphere.kind == "chrome" and (seen := review.highlights_px) is not None:
            count = int(np.isfinite(seen[index, :, 0]).sum())
            lines.append(f"highlight (yellow; of this frame: blue) in {count} of {seen.shape[1]} frames")
    lines += [f"diameter {ball.diameter_mm:g} mm"] if ball.diameter_mm else []
    return "\n".join(f"- {line}" for line in lines)


def _factor(window: ReviewWindow) -> str:
    lights = window.review.lights
    return f"{window.factor or (fitting_factor(lights) if lights is not None else 1)} times"


def _light_facts(window: ReviewWindow) -> str:
    review, index, lights = window.review, window.frame, window.review.lights
    if lights is None:
        return f"**No lights**: {review.missing.get('lights', '')}"
    facts, sigma, spread = (
        lights.facts()["frames"][index],
        lights.direction_sigma_deg[index],
        lights.intensity_sigma[index],
    )
    lines = [
        f"**{index + 1} {plain(lights.names[index])}**, {lights.model}",
        f"- {facts['zenith_deg']:.1f}° from the camera's axis, azimuth {facts['azimuth_deg']:.1f}° (0° right, 90° up)",
        f"- sigma {sigma:.2f}°" if np.isfinite(sigma) else "- sigma: not known, the lights were given",
        f"- intensity {facts['intensity_mean']:.3f}" + (f" ± {spread:.1%}" if np.isfinite(spread) else ""),
    ]
    if lights.positions_mm is not None:
        covariance = review.position_covariance_mm2
        told = "; how uncertain its place is, is not in this folder: calibrate again to have its ellipsoid"
        if covariance is not None and np.isfinite(covariance[index]).all():
            along = lights.directions[index]
            told = f" ± {np.sqrt(along @ covariance[index] @ along):.1f} mm"
        lines.append(f"- {facts['distance_mm']:.0f} mm from the object{told}")
    return "\n".join([*lines, *(f"- **{plain(flag)}**" for flag in lights.flags[index])])


LIGHTS = (
    text(lambda window: "The flashes around the object, each with the ellipsoid of its sigma. A click chooses one."),
    Row("dropdown", "sigma drawn", _factor, lambda window, value: window.choose(factor=int(value.split()[0])),
        {"options": tuple(f"{factor} times" for factor in FACTORS)}),
    text(_light_facts),
)  # fmt: skip


def _errors(window: ReviewWindow) -> str:
    summary = read_optional(window.review.store, "summary.json")
    methods = ((summary if isinstance(summary, dict) else {}).get("compare") or {}).get("methods") or {}
    rows = [
        (plain(name), f"{value:.2f}")
        for name in window.review.material.methods
        if (value := ((methods.get(name) or {}).get("real") or {}).get("median_deg")) is not None
    ]
    return table(("method", "median error, °"), rows) or (
        "How far each method is from the truth is told once **Verdict** has run."
    )


def _methods(window: ReviewWindow) -> dict[str, Any]:
    return {"options": tuple(window.review.material.methods) or (NONE,), "value": window.method or NONE}


SOLVE = (
    Row("dropdown", "normals of", _methods, lambda window, value: window.choose(method=value), {"options": (NONE,)}),
    text(_errors),
)


def _twin(window: ReviewWindow) -> str:
    if window.beside is None:
        return f"**No twin**: {window.review.missing.get('twin', '')}"
    return f"Right: the {window.beside.caption.removeprefix('twin, the ')}."


def _report_link(window: ReviewWindow) -> str:
    address = escape(window.report)
    return f'<p><a href="{address}" target="_blank" rel="noopener">Open the report alone</a></p>' if address else ""


VERDICT = (
    Row("html", show=_report_link),
    text(lambda window: "" if window.report else "There is no report yet: **Run everything** makes it."),
    Row("button", "Read the folder again", use=lambda window: window.read_again()),
    Row("button", "Forget what was kept", lambda window: {"visible": is_kept(window.review.store)},
        lambda window: window.forget(), {"kind": "danger", "visible": False}),
)  # fmt: skip

SESSION_TABS = {"Capture": CAPTURE, "Balls": balls_panel, "Lights": LIGHTS, "Scan": ScanPanel, "Solve": SOLVE,
                "Twin": (text(_twin),), "Verdict": VERDICT}  # fmt: skip
