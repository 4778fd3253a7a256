"""The rows of a session: a tab for each step, its warnings, what is run; and a shoot that is under way."""

from dataclasses import replace
from html import escape
from typing import Any

import numpy as np

from draw.readable import readable, share
from scene.reading import reading
from shoot.watch.watch_folder import STATUS, place_text
from studio.session.ball_rows import BALL_ROWS
from studio.session.folder import STEPS, Review, Warned, is_kept
from studio.session.session_window import SessionWindow
from studio.tabs import WORK_ROWS, tab_rows
from studio.widgets import Row, button, code, plain, text

NONE = "(no method has run)"
MOST = 60
"""Warnings that are listed; more would only be scrolled through."""
SHOWN = 6
"""Of a shoot's warnings, the newest."""
OVER = (
    "**The shoot is over.** Its photographs are decoded; then the session is shown here. If it does not come: the "
    "terminal of `rgbn watch` says why."
)
HOW = (
    "Where the pose is refused or wrong: click a point in the photograph, then the same point on the scan. Four pairs "
    "at least, better six, spread over the object. **Run up to Scan** refines the pose that they give."
)


def _frame_facts(window: SessionWindow) -> str:
    review, frames = window.review, window.review.material.frames
    if frames is None:
        return "" if review.preview is None else "A preview, as long as no photograph is decoded here."
    facts = [f"**{plain(frames.names[window.frame])}**, {frames.width} x {frames.height} px"]
    if review.clipped_share is not None:
        facts.append(f"clipped {share(review.clipped_share[window.frame], 2)} % (red)")
    if review.lights is not None:
        facts += [f"**{plain(flag)}**" for flag in review.lights.flags[window.frame]]
    return ", ".join(facts)


def _look(kind: str, name: str, label: str, **start: Any) -> Row:
    """Return a row for a field of `Look`."""
    return Row(kind, label, lambda window: getattr(window.how, name),
               lambda window, value: window.choose(how=replace(window.how, **{name: value})), start)  # fmt: skip


def _light_facts(window: SessionWindow) -> str:
    review, index, lights = window.review, window.frame, window.review.lights
    if lights is None:
        return f"**No lights**: {review.missing.get('lights', '')}"
    facts, spread = lights.facts()["frames"][index], lights.intensity_sigma[index]
    intensity = f"- intensity {readable(facts['intensity_mean'], 3)}"
    return "\n".join([
        f"**{index + 1} {plain(lights.names[index])}**, {lights.model}", f"- {place_text(facts)}",
        intensity + (f" ± {share(spread, 1)} %" if np.isfinite(spread) else ""),
        *(f"- **{plain(flag)}**" for flag in lights.flags[index]),
    ])  # fmt: skip


def _pose_facts(window: SessionWindow) -> str:
    review = window.review
    if "scan" in review.missing:
        return f"**Not registered**: {review.missing['scan']}"
    if not (pose := review.pose):
        return "The ground truth was given, not registered from a scan."
    return (
        f"Registered: outline to {readable(pose['residual_px'])} px rms, place ± {readable(pose['sigma_mm'])} mm, "
        f"turn ± {readable(pose['sigma_deg'])}°. Pink: its outline. **Verdict** shows it shaded."
    )


TABS: dict[str, Any] = {
    "Capture": (
        text(lambda window: "" if _is_shooting(window) else window.review.lacks),
        Row("slider", "frame", lambda window: {
            "max": max(len(window.review.names), 2), "disabled": len(window.review.names) < 2,
            "value": window.frame + 1}, lambda window, value: window.choose(frame=int(value) - 1),
            {"min": 1, "max": 2, "step": 1, "initial_value": 1, "hint": "Or click one in the strip"}),
        text(_frame_facts),
        Row("folder", "Over the photograph", rows=(
            _look("checkbox", "marks_object", "mark the object", initial_value=False),
            _look("slider", "brightness", "brightness", min=0.2, max=8.0, step=0.1, initial_value=1.0),
            _look("checkbox", "marks_clipped", "mark clipped pixels", initial_value=True),
        )),
        button("Show all of it", lambda window: window.choose(looks=window.looks + 1, ball=None)),
    ),
    "Balls": BALL_ROWS,
    "Lights": (
        text("The flashes around the object. A click chooses one."),
        text(_light_facts),
    ),
    "Scan": (
        text(_pose_facts),
        Row("folder", "Pick points", rows=(
            text(HOW),
            button("Start picking", lambda window: window.toggle_picking(),
                   lambda window: {"label": "Stop picking" if window.is_picking else "Start picking"}),
            text(lambda window: f"{window.picks.pairs} pairs." + (
                " Now the same point on the scan." if window.picks.wants_point else "")),
        )),
    ),
    "Solve": (
        Row("dropdown", "normals of", lambda window: {
            "options": tuple(window.review.material.methods) or (NONE,), "value": window.method or NONE},
            lambda window, value: window.choose(wanted=value), {"options": (NONE,)}),
        text("How far each method is from the truth: **Verdict**."),
    ),
    "Twin": (text(lambda window: f"**No twin**: {window.review.missing['twin']}" if "twin" in window.review.missing
                  else "Rendered: **Verdict** lays its frames over the photographs."),),
    "Verdict": (
        Row("html", show=lambda window: window.report and (
            f'<p><a href="{escape(window.report)}" target="_blank" rel="noopener">Open the report alone</a></p>')),
        text(lambda window: "" if window.report else "There is no report yet: **Run everything** makes it."),
        button("Read the folder again", lambda window: window.read_again()),
    ),
}  # fmt: skip


def warnings_of(review: Review, tab: str) -> list[Warned]:
    """Return the warnings that stand on a tab: each on the first one of its step; all of them under Verdict."""
    first = {step: name for name, step in reversed(STEPS.items())}
    return [one for one in review.warnings if tab in ("Verdict", first.get(one.step))]


def _mark(window: SessionWindow, tab: str) -> str:
    """Return what stands behind the name of a tab: how many warnings it has, or a tick where the step is done."""
    count = 0 if tab == "Verdict" else len(warnings_of(window.review, tab))
    return f"⚠{count}" if count else "✓" if STEPS[tab] in window.review.done else ""


def _warning_rows(window: SessionWindow) -> list[Row]:
    """Return the warnings; a press goes to a frame that one is about."""
    found, names, rows = warnings_of(window.review, window.tab), window.review.names, list[Row]()

    def to_frame(frame: int) -> Row:
        def show(window: SessionWindow) -> None:
            window.frame = frame
            window.open_tab("Capture")

        return button(f"Show {names[frame]}", show)

    for one in found[:MOST]:
        rows += [text(f"**{plain(one.step)}**: {plain(one.text)}"), *map(to_frame, one.frames[:4])]
    more = [text(f"{len(found) - MOST} more are in report.html.")] if len(found) > MOST else []
    return rows + more


def _run(window: SessionWindow) -> str:
    """Say what a run takes, and what other programs it would start: a folder from elsewhere may name any."""
    review = window.review
    if review.session is None:
        return plain(review.why_no_session)
    note = "as its session.toml says"
    if not window.is_kept_so:
        note = "with what you corrected, which is kept first"
    elif is_kept(review.store):
        note = "with the balls and picks that were kept"
    programs = ", ".join(map(code, review.programs))
    told = f"**{plain(review.session.name)}**, {note}. What is done and current is not done again."
    return told + (f" Other programs, as before: {programs}." if programs else "")


def shoot_text(window: SessionWindow) -> str:
    """Return how far a shoot is, as Markdown."""
    status = window.status
    with reading(window.folder / STATUS, "is no state of a shoot", do="It is written anew by rgbn watch."):
        if status["is_over"]:
            return OVER
        told = [plain(str(one)) for one in status["told"]]
        warned = [f"**{plain(str(one))}**" for one in reversed(list(status["warnings"])[-SHOWN:])]
        return "\n- ".join(["**Shoot under way**\n", *told, *warned])


def _is_shooting(window: SessionWindow) -> bool:
    status = window.status
    return isinstance(status, dict) and not (status.get("is_over") and window.review.names)


SESSION_ROWS = (
    text(lambda window: shoot_text(window) if _is_shooting(window) else ""),
    *tab_rows(TABS, _mark),
    Row("folder", "Warnings", lambda window: {
        "label": f"Warnings ({len(warnings_of(window.review, window.tab))})",
        "visible": bool(warnings_of(window.review, window.tab))}, start={"visible": False}, rows=_warning_rows,
        key=lambda window: (window.reading, window.tab)),
    text(_run),
    button("Keep", lambda window: window.write_kept(), lambda window: {"visible": not window.is_kept_so},
           visible=False, hint="For a later run"),
    *WORK_ROWS,
)  # fmt: skip
