"""The report's still maps of the object: normals, errors, sigma, albedo; the viewer reads their values."""

from compare.report import page, pictures
from compare.report.facts import Material, Summary, by_error, doubts_of
from compare.report.layers import Layers
from compare.report.page import absent, is_number, picture, say, section
from draw.object_charts import error_histograms


def normals_section(material: Material, layers: Layers | None, ranking: str) -> str:
    """Return the methods' ranking, and the truth's and every method's normals as colours, with the ball as a key."""
    figures = "" if layers is None else layers.html("normals")
    if not figures or layers is None:
        return section("normals", "Normals", ranking + absent("No normals are in this folder."))
    alt = "a ball coloured like the normals"
    ball = picture(pictures.legend_ball(180), alt, say("maps", "ball"), kind="map key-ball")
    lead = say("maps", "normals" if material.map_of("normals", "truth") is not None else "normals without truth")
    body = f'{ranking}<div class="gallery many">{ball}{figures}</div>'
    for kind, title in {"albedo": "Albedo", "sigma": "Standard deviation by noise (sigma)"}.items():
        if shown := layers.html(kind):
            scale = colour_scale(layers.scales["sigma"]["end_deg"]) if kind == "sigma" else ""
            body += f'<h3>{title}</h3>{scale}<div class="gallery many">{shown}</div>'
    return section("normals", "Normals", body, lead)


def errors_section(layers: Layers | None, summary: Summary) -> str:
    """Return error maps, real beside twin, on one colour scale, and their histogram."""
    compared = summary.get("compare") or {}
    end, title = compared.get("error_scale_deg"), "Where the errors are"
    if not is_number(end) or layers is None:
        return section("errors", title, absent(say("maps", "no error" if compared.get("has_truth") else "no truth")))
    methods, names, notes = compared["methods"], by_error(compared), ""
    any_twin = any(row.get("twin") for row in methods.values())
    for name in names:
        row, cells = methods[name], []
        for kind, words in {"real": "photographs", "twin": "twin"}.items():
            if row.get(kind):
                cells.append(say("maps", "error", name=name, on=words, **row[kind]))
            elif kind == "real" or any_twin:
                reason = "not rendered, or not solved on the twin" if kind == "twin" else "no normals here"
                cells.append(absent(f"{name}, {words}: {reason}."))
        if doubts_of(summary, name):
            cells.append('<a href="#normals">It doubts itself</a>.')
        if is_number(row.get("pearson")):
            cells.append(say("maps", "alike", **row))
        notes += f"<li>{'<br>'.join(cells)}</li>"
    twin = "" if any_twin else absent("No twin was solved: no map to lay beside these.")
    shown = f'{colour_scale(end)}<div class="gallery many">{layers.html("error")}</div><ul>{notes}</ul>{twin}'
    drawn = error_histograms(compared, names)
    body = shown + (page.chart(drawn, "speed") + "<p>Filled: photographs; line: twin.</p>" if drawn else "")
    return section("errors", title, body, say("maps", "errors", end=end))


def colour_scale(end: float) -> str:
    """Return the key of error colours, 0 to `end` degrees."""
    stops = ", ".join(f"rgb{colour}" for colour in pictures.error_scale_colours(17))
    ticks = "".join(f"<span>{end * part / 4:g}°{' and more' if part == 4 else ''}</span>" for part in range(5))
    return (
        f'<div class="scale" role="img" aria-label="colour scale, 0 to {end:g} degrees">'
        f'<div class="ramp" style="background: linear-gradient(to right, {stops})"></div>'
        f'<div class="ticks">{ticks}</div></div>'
    )
