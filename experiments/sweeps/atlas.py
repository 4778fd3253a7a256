"""The atlas: methods against factors in one picture, where each breaks, how, and whether it had said so."""

from collections.abc import Sequence
from html import escape

from draw.svg import svg
from experiments.stagings import ONE_FACTOR, SOLVERS
from experiments.sweeps.perturbation import BREAKS_DEG, PERTURBATIONS
from experiments.sweeps.stability import GOOD_DEG, KINDS, Level, Strip, Tolerance

LETTERS = {
    "no answer": "–", "flipped": "x", "relief": "r", "too flat": "f", "too steep": "s", "turned": "t",
    "scattered": "*",
}  # fmt: skip
GOOD, FAIR, BROKEN, NOTHING = "#d3e5f2", "#7fb2d6", "#D55E00", "#8a8f94"
"""Light to dark to another hue: told apart in gray, too."""
BOX, ROW, LEFT, TOP, GAP, NUMBER = 15.0, 42.0, 112.0, 66.0, 14.0, 112.0
NARROWEST, LEGEND = 120.0, 1180.0
SMALL = 4.8
"""Of a column, for its title; of the picture, for its legend; of a letter of the words under the boxes."""
BOX_HEIGHT = 17.0


def atlas(strips: Sequence[Strip], tolerances: Sequence[Tolerance]) -> str:
    """Return the picture as SVG; without tolerances it has no columns of numbers.

    A row for each method and profile, a column for each experiment: a box a level, in the experiment's own order. Under
    the boxes where it breaks, in the experiment's unit.
    """
    rows = list(dict.fromkeys((one.solver, one.profile) for one in strips))
    columns, x = [], LEFT
    for name in ONE_FACTOR:
        members = {(one.solver, one.profile): one for one in strips if one.experiment == name}
        if members:
            columns.append((x, name, members))
            words = max(len(one.breaks) for one in members.values())
            boxes = max(len(one.levels) for one in members.values())
            x += max(boxes * BOX, NARROWEST, SMALL * words) + GAP
    numbers = []
    for name in PERTURBATIONS:
        borne = {(one.solver, one.profile): one for one in tolerances if one.name == name}
        if borne:
            numbers.append((x, name, borne))
            x += NUMBER
    width, bottom = max(x, LEGEND), TOP + ROW * len(rows)
    parts = []
    for left, name, members in columns:
        first = next(iter(members.values())).levels
        ends = f"{first[0].label} … {first[-1].label}" if name != "material" else "kinds"
        parts += _head(left, ONE_FACTOR[name].label, ends)
    if numbers:
        parts.append(_text(numbers[0][0], 12, "smallest error that breaks it", fill="#555", size=10))
    for left, name, _ in numbers:
        parts += _head(left, PERTURBATIONS[name].label, name)
    for number, (solver, profile) in enumerate(rows):
        y = TOP + ROW * number
        is_first = not number or rows[number - 1][0] != solver
        if number and is_first:
            parts.append(f'<path d="M8 {y - 8:.0f}H{width - 8:.0f}" stroke="#c9d0d6"/>')
        if is_first:
            parts.append(_text(8, y + 13, SOLVERS.get(solver, solver), weight="600"))
        parts.append(_text(LEFT - 8, y + 13, profile, fill="#555", size=10, anchor="end"))
        for left, _, members in columns:
            if (solver, profile) in members:
                parts += _strip(members[solver, profile], left, y)
        for left, _, borne in numbers:
            if (solver, profile) in borne:
                parts += _tolerance(borne[solver, profile], left, y)
    return svg(round(width), round(bottom + 78), [*parts, *_legend(bottom + 12)], label="Where each method breaks")


def _head(x: float, label: str, below: str) -> list[str]:
    return [_text(x, 30, label, weight="600"), _text(x, 46, below, fill="#555", size=10)]


def _strip(strip: Strip, x: float, y: float) -> list[str]:
    parts = []
    for number, level in enumerate(strip.levels):
        at = x + BOX * number
        words = f"{strip.solver}, {strip.profile}, {strip.experiment} {level.label}: {_told(level)}"
        box = (
            f'<rect x="{at:.0f}" y="{y:.0f}" width="{BOX - 1:.0f}" height="{BOX_HEIGHT:.0f}" fill="{_colour(level)}"/>'
        )
        letter = ""
        if level.is_broken and level.how:
            letter = _text(at + BOX / 2 - 0.5, y + 13, LETTERS[level.how], fill="white", weight="600", anchor="middle")
        if level.is_broken and level.foretold:
            letter += f'<path d="M{at:.0f} {y + BOX_HEIGHT + 2:.0f}h{BOX - 1:.0f}" stroke="#1d2329" stroke-width="2"/>'
        parts.append(f"<g><title>{escape(words)}</title>{box}{letter}</g>")
    fill = "#777" if strip.breaks == "holds" else "#1d2329"
    return [*parts, _text(x, y + 29, strip.breaks.replace("_", " "), fill=fill, size=9)]


def _told(level: Level) -> str:
    median = "no median error" if level.median_deg is None else f"median {level.median_deg:.1f}°"
    if not level.is_broken:
        return median
    said = "doubted by the method itself" if level.foretold else "not doubted by the method"
    return f"{median}, broken in {level.broken_cells} of {level.cells} cells, {level.how}, {said}"


def _colour(level: Level) -> str:
    if level.is_broken:
        return NOTHING if level.how == "no answer" else BROKEN
    return GOOD if level.median_deg is not None and level.median_deg <= GOOD_DEG else FAIR


def _tolerance(one: Tolerance, x: float, y: float) -> list[str]:
    unit = PERTURBATIONS[one.name].unit
    if not one.draws:
        return [_text(x, y + 13, "failed" if one.failed else "not told them", fill="#777", size=10)]
    if one.breaks_at is None:
        return [_text(x, y + 13, f"over {PERTURBATIONS[one.name].most:g}{_spaced(unit)}", fill="#777")]
    shown = "broken without" if one.breaks_at == 0 else f"{_rounded(one.breaks_at)}{_spaced(unit)}"
    line = "underline" if one.foretold else "none"
    parts = [_text(x, y + 13, shown, weight="600", decoration=line)]
    ends = ["more" if v is None else _rounded(v) for v in (one.low, one.high)]
    spread = f"{ends[0]} to {ends[1]}, " if one.draws > 1 and ends[0] != ends[1] else ""
    failed = f", {one.failed} failed" if one.failed else ""
    return [*parts, _text(x, y + 29, spread + (one.how or "") + failed, fill="#555", size=9)]


def _rounded(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def _spaced(unit: str) -> str:
    return unit if unit == "°" else f" {unit}"


def _legend(y: float) -> list[str]:
    items = [
        (GOOD, "", f"median error up to {GOOD_DEG:g}°"),
        (FAIR, "", f"up to {BREAKS_DEG:g}°"),
        (BROKEN, "f", f"broken: past {BREAKS_DEG:g}°, or half of the cells are"),
        (NOTHING, "–", "no answer"),
    ]
    parts, x = [], LEFT
    for colour, letter, words in items:
        parts.append(f'<rect x="{x:.0f}" y="{y:.0f}" width="14" height="17" fill="{colour}"/>')
        parts.append(_text(x + 7, y + 13, letter, fill="white", weight="600", anchor="middle"))
        parts.append(_text(x + 20, y + 13, words))
        x += 44 + 6.6 * len(words)
    parts.append(f'<path d="M{x:.0f} {y + 12:.0f}h14" stroke="#1d2329" stroke-width="2"/>')
    parts.append(_text(x + 20, y + 13, "the method itself had doubted it"))
    words = "      ".join(f"{LETTERS[name]}  {name}: {meaning}" for name, meaning in KINDS.items())
    first, second = words[: words.index(f"{LETTERS['too flat']}  too flat")], words[words.index("f  too flat") :]
    return [*parts, _text(LEFT, y + 37, first, fill="#555"), _text(LEFT, y + 55, second, fill="#555")]


def _text(
    x: float, y: float, words: str, *, fill: str = "#1d2329", size: int = 12, weight: str = "400",
    anchor: str = "start", decoration: str = "none",
) -> str:  # fmt: skip
    return (
        f'<text x="{x:.0f}" y="{y:.0f}" fill="{fill}" font-size="{size}" font-weight="{weight}" '
        f'text-anchor="{anchor}" text-decoration="{decoration}" xml:space="preserve">{escape(words)}</text>'
    )
