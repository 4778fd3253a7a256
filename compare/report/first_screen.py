"""The report's first screen: verdict, four numbers with their uncertainty, one picture, warnings."""

from html import escape

import numpy as np

from compare.report import page, pictures
from compare.report.facts import Material, Summary
from compare.report.layers import Layers
from compare.report.maps import colour_scale
from compare.report.registration_pictures import raking_frame
from compare.report.verdict import Statement, verdict
from scene.map_pictures import normal_picture

MOST_WARNINGS = 2
PICTURE_WIDTH = 300


def first_screen(
    material: Material, layers: Layers | None, summary: Summary, warnings: list[tuple[str, str]], best: str | None
) -> str:
    """Return the section that a busy reader needs: how good, by which numbers, what to do."""
    first, *others = statements = verdict(summary)
    badge = f'<span class="badge {first.level} big">{page.LEVELS[first.level].capitalize()}</span>'
    advice = page.say("advice", first.level)
    head = f'<p class="headline">{badge} {first.html}</p>'
    head += f'<p class="advice"><b>Why:</b> {_limits(summary, others, warnings)}</p>'
    head += f'<p class="advice"><b>What to do:</b> {advice}</p>'
    tiles = "".join(_tile(*tile) for tile in _numbers(summary, statements, best))
    marked = [s for s in others if s.level in ("care", "bad") and s.topic not in ("Lights", "Ground truth", "Twin")]
    notes = "".join(f"<li>{page.badge(s.level)} {_shortened(s.topic, s.text)}</li>" for s in marked)
    notes = f"<ul>{notes}</ul>" if notes else ""
    counted = {0: "none", 1: "one"}.get(len(warnings), "many")
    told = page.say("warnings", counted, count=str(len(warnings)))
    # That no step warned is no comfort beside what the verdict marks.
    if warnings or not notes:
        listed = "".join(f"<li>{_shortened(step, text)}</li>" for step, text in warnings[:MOST_WARNINGS])
        notes += f"<p>{told}</p><ul>{listed}</ul>" if listed else f"<p>{told}</p>"
    notes = f'<div class="notes">{notes}</div>'
    left = f'<div>{head}<ul class="tiles">{tiles}</ul>{notes}</div>'
    body = f'<div class="first">{left}{_picture(material, layers, summary, best)}</div>'
    return page.section("verdict", "What was found", body)


def _limits(summary: Summary, statements: list[Statement], warnings: list[tuple[str, str]]) -> str:
    """Return what makes the error, as far as twin, ground truth and lights tell, or why that is not known."""
    compared = summary.get("compare") or {}
    if not compared.get("has_truth"):
        return page.say("limits", "without truth")
    named, truth = [f"{s.topic} {s.level}" for s in statements], compared.get("truth") or {}
    told = [page.say("limits", name, **truth) for name in named if name in page.words("limits")]
    warned = {step for step, _ in warnings if step in ("calibrate", "align")}
    told += [page.say("limits", "warned", steps=" and ".join(sorted(warned)))] if warned else []
    return " ".join(told) or page.say("limits", "not told")


def why_section(summary: Summary) -> str:
    """Return the verdict's statements, one a topic, with their badges."""
    lines = "".join(f"<li><h3>{s.topic} {page.badge(s.level)}</h3><p>{s.html}</p></li>" for s in verdict(summary))
    return page.section("why", "Why: each result in a sentence", f'<ul class="statements">{lines}</ul>')


def _shortened(step: str, text: str) -> str:
    return f"<b>{escape(step or 'session')}</b> {escape(text if len(text) < 120 else text[:117] + '…')}"


def _tile(title: str, anchor: str, level: str, value: str, uncertainty: str) -> str:
    return (
        f'<li><a href="#{anchor}">{title}</a> {page.badge(level)}<p class="value">{value}</p><p>{uncertainty}</p></li>'
    )


def _numbers(summary: Summary, statements: list[Statement], best: str | None) -> list[tuple[str, str, str, str, str]]:
    """Return title, section, level, value and its uncertainty of normals, ground truth, lights and twin."""
    levels = {s.topic: s.level for s in statements}
    compared = summary.get("compare") or {}
    row = (compared.get("methods") or {}).get(best or "") or {}
    real, truth, align = row.get("real") or {}, compared.get("truth") or {}, summary.get("align") or {}
    calibrate, lights = summary.get("calibrate") or {}, compared.get("lights") or {}
    sigma = next(
        (part[key] for part in (calibrate, lights) for key in ("direction_sigma_deg_median",) if part.get(key)), None
    )
    intensity, off = calibrate.get("intensity_sigma_median"), align.get("residual_px")
    normals = page.number(real.get("median_deg"), 1, "°")
    if page.is_number(row.get("median_sigma_deg")):
        normals += f" ± {page.number(row['median_sigma_deg'], 1, '°')}"
    answered = f"{page.percent(row.get('coverage'))} of the object answered" if real else "nothing to measure it by"
    twin = (row.get("twin") or {}).get("median_deg")
    outline = f"outline off by {page.number(off, 2, 'px')}" if page.is_number(off) else "no scan was registered"
    strength = f"intensity ± {page.percent(intensity, 1)}" if page.is_number(intensity) else "intensity not known"
    alike = (
        f"1: at the same places, 0: unrelated; its median error {page.number(twin, 1, '°')}"
        if page.is_number(twin)
        else "there is no twin"
    )
    numbers = {
        "Normals": ("Median error", "errors", normals, answered),
        "Ground truth": (
            "Truth uncertain by",
            "registration",
            page.number(truth.get("sigma_deg_median"), 1, "°"),
            outline,
        ),
        "Lights": ("Lights uncertain by", "lights", page.number(sigma, 2, "°"), strength),
        "Twin": ("Twin errs alike", "twin", page.number(row.get("pearson"), 2), alike),
    }
    return [
        (title, anchor, levels.get(topic, "unknown"), value, more)
        for topic, (title, anchor, value, more) in numbers.items()
    ]


def _picture(material: Material, layers: Layers | None, summary: Summary, best: str | None) -> str:
    """Return photograph, normals and error of the best method beside each other."""
    if layers is None:
        return ""
    grid, shown = layers.grid, []
    if material.frames is not None and material.exposure is not None and len(material.frames):
        index = 0 if material.directions is None else raking_frame(material.directions)
        index = min(index, len(material.frames) - 1)
        width = grid.box.shown_width(PICTURE_WIDTH)
        shown.append((material.photograph(index, grid.box, width), "photograph"))
    normals = material.map_of("normals", best) if best else None
    end = (summary.get("compare") or {}).get("error_scale_deg")
    if normals is not None:
        shown.append((normal_picture(grid.box.of(normals), grid.box.shown_width(PICTURE_WIDTH)), f"normals, {best}"))
        error = material.map_of("compare", f"error_real_{best}")
        if error is not None and page.is_number(end):
            small = pictures.shrink(grid.box.of(error), grid.box.shown_width(PICTURE_WIDTH))
            shown.append((pictures.error_picture(small, end), f"its error, 0° to {end:g}°"))
    figures = "".join(
        page.picture(np.ascontiguousarray(image), words, escape(words), photograph=words == "photograph")
        for image, words in shown
    )
    scale = colour_scale(end) if page.is_number(end) and len(shown) == 3 else ""
    return f'<div class="glance"><div class="row">{figures}</div>{scale}<p><a href="#viewer">Look closely</a></p></div>'
