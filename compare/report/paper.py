"""report.pdf: the report on two pages of A4, to be filed with the object: PDF/A, all its text can be selected."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from html import escape
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report import page, pictures
from compare.report.facts import Material, Summary
from compare.report.pictures import PixelBox
from compare.report.registration_pictures import SCAN_COLOUR, raking_frame
from draw import light_charts
from scene.errors import SceneError
from scene.files import write_whole
from scene.map_pictures import Image, data_uri, known_pixels, normal_picture, shrink
from scene.store import Store

NAME = "report.pdf"
MARGIN_MM, WIDE_MM, GAP_MM = 15.0, 180.0, 6.0
PICTURE_PX, MAP_PX = 1400, 900
HIGHEST_MM = 58.0
"""Of a picture."""
SIZES_PT = (8.0, 7.0, 6.0, 5.0)
"""Of the text: the largest by which all fits on `MOST_PAGES`. Else it takes more pages: nothing is left out."""
MOST_PAGES = 2
MOST_BALLS = 12
"""More are not all listed."""
BALL_COLOUR = (255, 200, 0)
COLOURS = {"good": (0, 81, 61), "care": (133, 84, 0), "bad": (163, 60, 0), "unknown": (80, 80, 80)}
"""Of a verdict's badge, by its level: as on the page, dark enough for white letters."""
GREY = (105, 112, 120)
FONTS = {"": "Roboto-Medium.ttf", "B": "Roboto-Bold.ttf"}
"""Open3D brings them: Latin, Greek and Cyrillic letters."""
XMP = """<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description rdf:about="" xmlns:dc="http://purl.org/dc/elements/1.1/" xmlns:xmp="http://ns.adobe.com/xap/1.0/"
 xmlns:pdf="http://ns.adobe.com/pdf/1.3/" xmlns:pdfaid="http://www.aiim.org/pdfa/ns/id/"
 xmp:CreateDate="{date}" xmp:ModifyDate="{date}" pdf:Producer="rgbn">
<pdfaid:part>2</pdfaid:part><pdfaid:conformance>U</pdfaid:conformance>
<dc:title><rdf:Alt><rdf:li xml:lang="x-default">{title}</rdf:li></rdf:Alt></dc:title>
</rdf:Description></rdf:RDF></x:xmpmeta>"""
"""fpdf2's own has the time of day in it, and the file would be another at each run."""


def write_paper(store: Store, name: str, subtitle: str, facts: Summary, digests: Mapping[str, str | None]) -> Path:
    """Write report.pdf: what report.html says, without its viewer. The same facts give the same bytes.

    Parameters
    ----------
    store : Store
    name : str
        The session's.
    subtitle : str
        HTML, as all texts of `facts`.
    facts : dict
        What the templates of report.html are filled in with.
    digests : mapping of str to str or None
        SHA-256 of files by name; None: the file is not there.
    """
    for size in (*SIZES_PT, SIZES_PT[0]):
        paper = _Paper(name, facts["created"] or "", size)
        paper.fill(subtitle, facts, digests, store.folder.resolve())
        printed = paper.pdf.output()
        if paper.pdf.pages_count <= MOST_PAGES:
            break
    with write_whole(store.path(NAME)) as file:
        file.write(printed)
    return store.path(NAME)


class _Paper:
    """The pages so far. `size`: of the text, points."""

    def __init__(self, name: str, created: str, size: float) -> None:
        from fpdf import FPDF
        from fpdf.fonts import TTFFont

        spec = find_spec("open3d")
        assert spec is not None
        assert spec.submodule_search_locations
        self.pdf = pdf = FPDF(format="A4", enforce_compliance="PDF/A-2U")
        for style, file in FONTS.items():
            pdf.add_font("text", style, Path(spec.submodule_search_locations[0], "resources", file))
        font = pdf.fonts["text"]
        assert isinstance(font, TTFFont)
        self.size, self._known = size, font.cmap
        pdf.c_margin = 0
        pdf.footer = self.foot
        pdf.set_margins(MARGIN_MM, MARGIN_MM)
        pdf.set_auto_page_break(True, MARGIN_MM)
        pdf.set_creation_date(datetime.fromisoformat(created or "2000-01-01T00:00:00+00:00"))
        self.name = self.letters(escape(name))
        pdf.set_title(self.name)
        pdf.set_producer("rgbn")
        date = pdf.creation_date.isoformat(timespec="seconds")
        pdf.set_xmp_metadata(XMP.format(date=date, title=escape(self.name)))
        pdf.add_page()

    def letters(self, html: str) -> str:
        """Return the text of a piece of HTML; a letter that the font lacks by its code."""
        shown = page.plain(html).replace("\u202f", "\u00a0")
        return "".join(
            one if ord(one) in self._known else one.encode("ascii", "backslashreplace").decode() for one in shown
        )

    def say(
        self, html: str, *, size: float = 0.0, style: str = "", colour: Sequence[int] = (0, 0, 0), **how: Any
    ) -> None:
        """Write a paragraph."""
        size = size or self.size
        self.pdf.set_font("text", style, size)
        self.pdf.set_text_color(*colour)
        how = {"w": 0, "new_x": "LMARGIN", "new_y": "NEXT", "align": "L", **how}
        self.pdf.multi_cell(h=0.46 * size, text=self.letters(html), **how)
        self.pdf.set_text_color(0)

    def foot(self) -> None:
        """End a page."""
        self.pdf.set_y(-MARGIN_MM + 3)
        self.say(f"{escape(self.name)} · page {self.pdf.page_no()} of {{nb}}", size=7, colour=GREY, align="R")

    def head(self, words: str) -> None:
        """Begin a part."""
        if self.pdf.will_page_break(14):
            self.pdf.add_page()
        self.pdf.ln(2.5)
        self.say(words, size=10, style="B")
        self.pdf.ln(0.8)

    def table(self, head: Sequence[str], rows: Iterable[Sequence[str]], widths: Sequence[float]) -> None:
        """Write a table of cells that are HTML; `widths`: shares."""
        from fpdf.fonts import FontFace

        self.pdf.set_font("text", "", self.size)
        self.pdf.set_draw_color(190)
        how = {"borders_layout": "HORIZONTAL_LINES", "line_height": 0.5 * self.size, "padding": (0.4, 1)}
        with self.pdf.table(
            col_widths=tuple(widths), text_align="LEFT", headings_style=FontFace("text", "B"), **how
        ) as table:
            for cells in (head, *rows):
                table.row([self.letters(cell) for cell in cells])

    def picture(self, image: Image, box: tuple[float, float, float], alt: str, *, photograph: bool = False) -> float:
        """Place a picture at left, top, as wide as may be, and go below it; return the millimetres of its pixels."""
        left, top, wide = box
        scale = min(wide / image.shape[1], HIGHEST_MM / image.shape[0])
        uri = data_uri(image, photograph=photograph)
        self.pdf.image(uri, left, top, scale * image.shape[1], alt_text=self.letters(escape(alt)))
        self.pdf.set_y(top + scale * image.shape[0] + 1)
        return scale

    def fill(self, subtitle: str, facts: Summary, digests: Mapping[str, str | None], folder: Path) -> None:
        """Write all parts."""
        material, statement = facts["material"], facts["statements"][0]
        self.say("Photometric stereo report", colour=GREY)
        self.say(escape(self.name), size=18, style="B")
        self.say(subtitle, colour=GREY)
        self.pdf.ln(2)
        word = statement.word or page.LEVELS[statement.level]
        self.pdf.set_fill_color(*COLOURS[statement.level])
        self.say(word.capitalize(), size=13, style="B", colour=(255, 255, 255), fill=True, padding=(1, 2))
        self.pdf.set_fill_color(255)
        self.pdf.ln(1)
        self.say(statement.html, size=self.size + 2)
        for what, told in (
            ("Why", facts["limits"]),
            ("What to do", page.say("advice", statement.word or statement.level)),
        ):
            self.say(f"{what}: {told}")
        self.setup(material)
        self.maps(material, facts["best"] or "", facts["compare"].get("error_scale_deg"))
        self.head("Each result")
        rows = [[one.topic, one.word or page.LEVELS[one.level], one.html] for one in facts["statements"]]
        self.table(("result", "verdict", "what was found"), rows, (16, 16, 120))
        if ranking := facts["ranking"]:
            self.head("Methods")
            # What a method doubts stands among the warnings, whole.
            head, lines = page.cells_of("ranking" if ranking[0].get("real") else "without truth", ranking)
            self.table(head[:-1], [line[:-1] for line in lines], [2, *[1] * (len(head) - 2)])
        if material.spheres:
            self.head("Calibration balls")
            self.table(*page.cells_of("balls", material.spheres[:MOST_BALLS]), [1] * 6)
            if (more := len(material.spheres) - MOST_BALLS) > 0:
                self.say(page.say("balls", "more", count=more))
        if facts["registration_rows"]:
            self.head("Registration of the scan")
            self.table(*page.cells_of("registration", facts["registration_rows"]), (2, 1))
        self.head("Warnings")
        for step, text in facts["warnings"]:
            self.say(escape(f"{step or 'session'}: {text}"))
            self.pdf.ln(0.4)
        if not facts["warnings"]:
            self.say(page.say("warnings", "none"))
        self.head("Files and versions")
        self.say(f"Folder: {escape(str(folder))}", link=folder.as_uri())
        self.say(escape(f"Versions: {page.as_text(facts['versions'])}"))
        self.pdf.ln(1)
        rows = [[escape(name), found or "is not there"] for name, found in digests.items()]
        self.table(("file", "SHA-256 of its content"), rows, (1, 2))

    def setup(self, material: Material) -> None:
        """Show a photograph with balls and object outlined, and where the lights stand."""
        self.head("The set-up")
        top, frames, known = self.pdf.get_y(), material.frames, material.lights or {}
        wide, lit = 0.6 * WIDE_MM, known.get("frames") and known.get("model") != "unknown"
        if frames is None:
            self.say("The decoded frames are not in this folder any more.", w=wide)
        else:
            index = 0 if material.directions is None else raking_frame(material.directions[: len(frames)])
            whole = PixelBox(0, 0, frames.width, frames.height)
            shown = material.photograph(index, whole, PICTURE_PX)
            scale = self.picture(shown, (MARGIN_MM, top, wide), "the set-up", photograph=True)
            scale *= shown.shape[1] / frames.width
            for colour, lines in _lines(material, whole):
                self.pdf.set_draw_color(*colour)
                self.pdf.set_line_width(0.35)
                for line in lines:
                    self.pdf.polyline((line * scale + [MARGIN_MM, top]).tolist(), polygon=True)
            self.pdf.set_line_width(0.2)
            caption = f"{frames.names[index]}, with the outlines of the object (pink) and of the balls (yellow)."
            caption += " Beside it the lights, as the camera sees them." if lit else ""
            self.say(escape(caption), colour=GREY)
        if lit:
            left = MARGIN_MM + wide + GAP_MM
            chart = light_charts.directions(known).replace("system-ui, 'DejaVu Sans', sans-serif", "text")
            self.pdf.image(BytesIO(chart.encode()), left, top, min(HIGHEST_MM, WIDE_MM - wide - GAP_MM))
            self.pdf.set_y(max(self.pdf.get_y(), top + HIGHEST_MM))

    def maps(self, material: Material, best: str, end: Any) -> None:
        """Show one method's normals, and by how much they are off."""
        normals, error = material.map_of("normals", best), material.map_of("compare", f"error_real_{best}")
        if normals is None:
            return
        self.head(f"Normals and their errors, method {escape(best)}")
        box = PixelBox.of_mask(known_pixels(normals), margin=0.04)
        top, wide, width = self.pdf.get_y(), (WIDE_MM - GAP_MM) / 2, box.shown_width(MAP_PX)
        self.picture(normal_picture(box.of(normals), width), (MARGIN_MM, top, wide), f"normals, {best}")
        bottom = self.pdf.get_y()
        self.say("The normals: red to the right, green up, blue toward the camera.", colour=GREY, w=wide)
        if error is not None and page.is_number(end):
            left = MARGIN_MM + wide + GAP_MM
            shown = pictures.error_picture(shrink(box.of(error), width), end)
            wide = shown.shape[1] * self.picture(shown, (left, top, wide), f"error, {best}")
            bar = pictures.error_picture(np.linspace(0, end, 256)[None], end)
            self.pdf.image(data_uri(bar, photograph=False), left, bottom + 0.5, wide, 2.5)
            for part, align in enumerate("LCR"):
                self.pdf.set_xy(left, bottom + 3.5)
                words = page.round_number(end * part / 2, "°") + (" and more" if part == 2 else "")
                self.say(words, colour=GREY, w=wide, align=align)
            self.pdf.set_x(left)
            self.say("The angle to the ground truth's normals; grey: unknown.", colour=GREY, w=WIDE_MM / 2)


def _lines(material: Material, box: PixelBox) -> list[tuple[tuple[int, int, int], list[NDArray[np.float64]]]]:
    """Return the outlines of the object and of the balls in the photographs, with their colours, pixels of the box."""
    spheres, mask, camera = [], material.mask, material.camera
    with suppress(SceneError):
        spheres = material.store.load_spheres()
    seen = (one for one, row in zip(spheres, material.spheres, strict=False) if not row.get("apart"))
    balls = [] if camera is None else [one.outline(camera) + 0.5 for one in seen]
    shape = [] if mask is None or mask.shape != (box.height, box.width) else pictures.contours(mask, box)
    return [(SCAN_COLOUR, shape), (BALL_COLOUR, balls)]
