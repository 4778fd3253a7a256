"""report.pdf: the report on two pages of A4, to be filed with the object: PDF/A, all its text can be selected."""

from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from html import escape
from importlib.metadata import distribution
from io import BytesIO
from pathlib import Path
from typing import Any

from compare.report import page, pictures
from compare.report.facts import Material, Summary
from compare.report.pictures import PixelBox
from draw import light_charts
from draw.readable import is_number
from scene.files import write_whole
from scene.map_pictures import Image, data_uri, known_pixels, normal_picture, shrink
from scene.store import Store

MARGIN_MM, WIDE_MM, GAP_MM, HIGHEST_MM = 15.0, 180.0, 6.0, 58.0
"""Of the pages; of the pictures, the gap between two and the height at most."""
PICTURE_PX = 1200
SIZES_PT, MOST_PAGES = (8.0, 7.0, 6.0, 5.0), 2
"""Of the text: the largest by which all fits on these pages. Else it takes more: nothing is left out."""
GREY = (105, 112, 120)
COLOURS = {"good": (0, 81, 61), "care": (133, 84, 0), "bad": (163, 60, 0), "unknown": (80, 80, 80)}
"""Of a verdict, by its level: as on the page, dark enough for white letters."""
FONTS = {"": "Roboto-Medium.ttf", "B": "Roboto-Bold.ttf"}
"""Open3D brings them: Latin, Greek and Cyrillic letters."""
XMP = """<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description rdf:about="" xmlns:dc="http://purl.org/dc/elements/1.1/" xmlns:xmp="http://ns.adobe.com/xap/1.0/"
 xmlns:pdf="http://ns.adobe.com/pdf/1.3/" xmlns:pdfaid="http://www.aiim.org/pdfa/ns/id/" pdfaid:part="2"
 pdfaid:conformance="U" xmp:CreateDate="{date}" xmp:ModifyDate="{date}" pdf:Producer="rgbn">
<dc:title><rdf:Alt><rdf:li xml:lang="x-default">{title}</rdf:li></rdf:Alt></dc:title>
</rdf:Description></rdf:RDF></x:xmpmeta>"""
"""What fpdf2 itself would write has the time of day in it."""


def write_paper(store: Store, name: str, subtitle: str, facts: Summary, digests: Mapping[str, str | None]) -> None:
    """Write report.pdf: what report.html says, without its viewer. The same facts give the same bytes.

    facts: What the templates of report.html are filled in with; digests: as `report.write_report` has them.
    """
    for size in (*SIZES_PT, SIZES_PT[0]):
        paper = _Paper(name, facts.get("created") or "", size)
        paper.fill(subtitle, facts, digests, store.folder.resolve())
        printed = paper.pdf.output()
        if paper.pdf.pages_count <= MOST_PAGES:
            break
    with write_whole(store.path("report.pdf")) as file:
        file.write(printed)


class _Paper:
    """The pages so far. `size`: of the text, points. Texts are HTML."""

    def __init__(self, name: str, created: str, size: float) -> None:
        from fpdf import FPDF

        self.pdf = pdf = FPDF(format="A4", enforce_compliance="PDF/A-2U")
        for style, file in FONTS.items():
            pdf.add_font("text", style, str(distribution("open3d").locate_file(f"open3d/resources/{file}")))
        font: Any = pdf.fonts["text"]
        self.size, self._known = size, font.cmap
        self.name = escape(self.letters(escape(name)))
        date = datetime.fromisoformat(created or "2000-01-01T00:00:00+00:00")
        pdf.set_creation_date(date)
        pdf.set_producer("rgbn")
        pdf.set_xmp_metadata(XMP.format(date=date.isoformat(timespec="seconds"), title=self.name))
        pdf.set_margins(MARGIN_MM, MARGIN_MM)
        pdf.set_auto_page_break(True, MARGIN_MM)
        pdf.c_margin, pdf.footer = 0, self.foot
        pdf.add_page()

    def letters(self, html: str) -> str:
        """Return the text of a piece of HTML; a letter that the font lacks by its code."""
        shown = page.plain(html).replace("\u202f", "\u00a0")
        known = (one if ord(one) in self._known else one.encode("ascii", "backslashreplace").decode() for one in shown)
        return "".join(known)

    def say(self, html: str, size: float = 0, style: Any = "", colour: Sequence[int] = (0, 0, 0), **how: Any) -> None:
        """Write a paragraph."""
        self.pdf.set_font("text", style, size or self.size)
        self.pdf.set_text_color(*colour)
        how = {"w": 0, "new_x": "LMARGIN", "new_y": "NEXT", "align": "L", **how}
        self.pdf.multi_cell(h=0.46 * (size or self.size), text=self.letters(html), **how)
        self.pdf.set_text_color(0)

    def foot(self) -> None:
        """End a page."""
        self.pdf.set_y(3 - MARGIN_MM)
        self.say(f"{self.name} · page {self.pdf.page_no()} of {{nb}}", 7, colour=GREY, align="R")

    def head(self, words: str) -> None:
        """Begin a part."""
        if self.pdf.will_page_break(24):
            self.pdf.add_page()
        self.pdf.ln(2.5)
        self.say(words, 10, "B")
        self.pdf.ln(0.8)

    def table(self, title: str, head: Sequence[str], rows: Iterable[Sequence[str]], widths: Sequence[float]) -> None:
        """Write a part that is a table; `widths`: shares."""
        self.head(title)
        self.pdf.set_font("text", "", self.size)
        self.pdf.set_draw_color(190)
        how = {"borders_layout": "HORIZONTAL_LINES", "line_height": 0.5 * self.size, "padding": (0.4, 1)}
        with self.pdf.table(col_widths=tuple(widths), text_align="LEFT", **how) as table:
            for cells in (head, *rows):
                table.row([self.letters(cell) for cell in cells])

    def picture(self, image: Image, left: float, wide: float, words: str, *, photograph: bool = False) -> None:
        """Place a picture here, as large as may be, its words below."""
        top, scale = self.pdf.get_y(), min(wide / image.shape[1], HIGHEST_MM / image.shape[0])
        uri, words = data_uri(image, photograph=photograph), escape(words)
        self.pdf.image(uri, left, top, scale * image.shape[1], alt_text=self.letters(words))
        self.pdf.set_xy(left, top + scale * image.shape[0] + 1)
        self.say(words, colour=GREY, w=wide)

    def fill(self, subtitle: str, facts: Summary, digests: Mapping[str, str | None], folder: Path) -> None:
        """Write all parts."""
        material, statements, ranking = facts["material"], facts["statements"], facts["ranking"]
        first = statements[0]
        self.say("Photometric stereo report", colour=GREY)
        self.say(self.name, 18, "B")
        self.say(subtitle, colour=GREY)
        self.pdf.ln(2)
        self.pdf.set_fill_color(*COLOURS[first.level])
        self.say(first.word.capitalize(), 13, "B", (255, 255, 255), fill=True, padding=(1, 2))
        self.pdf.set_fill_color(255)
        self.pdf.ln(1)
        self.say(first.html, self.size + 2)
        self.say(f"Why: {facts['limits']}")
        self.say(f"What to do: {facts['advice']}")
        self.setup(material)
        self.maps(material, facts["best"] or "", facts["compare"].get("error_scale_deg"))
        rows = [[one.topic, one.word, one.html + (f" ({escape(one.why)})" if one.why else "")] for one in statements]
        self.table("Each result", ("result", "verdict", "what was found"), rows, (16, 16, 120))
        if ranking:
            # What a method doubts stands among the warnings, whole.
            head, lines = page.cells_of(facts["ranking_table"], ranking)
            self.table("Methods", head[:-1], [line[:-1] for line in lines], [2, *[1] * (len(head) - 2)])
        if material.spheres:
            self.table("Calibration balls", *page.cells_of("balls", material.spheres), [1] * 6)
        if found := facts["registration_rows"]:
            self.table("Registration of the scan", *page.cells_of("registration", found), (2, 1))
        self.head("Warnings")
        warnings = [escape(f"{step or 'session'}: {text}") for step, text in facts["warnings"]]
        for text in warnings or [page.say("warnings", "none")]:
            self.say(text)
            self.pdf.ln(0.4)
        self.head("Versions and folder")
        self.say(escape(page.as_text(facts.get("versions") or {})))
        self.say(escape(str(folder)), link=folder.as_uri())
        rows = [[escape(name), found or "is not there"] for name, found in digests.items()]
        self.table("Files", ("file", "SHA-256 of its content"), rows, (1, 2))

    def setup(self, material: Material) -> None:
        """Show a photograph, and where the lights stand."""
        lights, frames, wide = material.lights or {}, material.frames, 0.6 * WIDE_MM
        lit = lights.get("frames") and lights.get("model") != "unknown"
        self.head("The set-up" + ("; the lights, as the camera sees them" if lit else ""))
        top = self.pdf.get_y()
        shown = material.exposure.develop(pictures.thumbnail(frames, material.raking, PICTURE_PX))
        self.picture(shown, MARGIN_MM, wide, frames.names[material.raking], photograph=True)
        if lit:
            chart = light_charts.directions(lights).replace("system-ui, 'DejaVu Sans', sans-serif", "text")
            self.pdf.image(BytesIO(chart.encode()), MARGIN_MM + wide + GAP_MM, top, HIGHEST_MM, alt_text="the lights")
            self.pdf.set_y(max(self.pdf.get_y(), top + HIGHEST_MM))

    def maps(self, material: Material, best: str, end: Any) -> None:
        """Show one method's normals, and by how much they are off."""
        normals, error = material.map_of("normals", best), material.map_of("compare", f"error_real_{best}")
        if normals is None:
            return
        self.head(f"Normals{'' if error is None else ' and their errors'}, method {escape(best)}")
        box = PixelBox.of_mask(known_pixels(normals), margin=0.04)
        top, wide, width = self.pdf.get_y(), (WIDE_MM - GAP_MM) / 2, box.shown_width(PICTURE_PX)
        words = "The normals: red to the right, green up, blue toward the camera."
        self.picture(normal_picture(box.of(normals), width), MARGIN_MM, wide, words)
        if error is not None and is_number(end):
            shown = pictures.error_picture(shrink(box.of(error), width), end)
            shown = pictures.with_colour_scale(pictures.enlarged(shown, -(-PICTURE_PX // width)), end, "")
            self.pdf.set_y(top)
            self.picture(shown, MARGIN_MM + wide + GAP_MM, wide, "The angle to the ground truth's; grey: unknown.")
