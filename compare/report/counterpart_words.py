"""What the page of two captures says in words: its answers, what its sigmas hold, how to read it."""

from html import escape
from typing import Any

from compare.report.page import is_number, number, percent, section, table
from compare.statistics.error_patterns import ALIKE_FROM, STRUCTURED

Found = dict[str, Any]

LEVELS = {"alike": "good", "not shown": "unknown", "differ": "bad"}
ANSWERS = {
    "level": {
        "alike": "The errors are as large on both, within the margin.",
        "not shown": "Neither that they are as large on both, nor that they differ by more than the margin, is shown.",
        "differ": "The errors of a method are larger on one of the two: by more than the margin, and more than chance.",
    },
    "pattern": {
        "alike": "Half of the methods or more err at the same places, and none at others.",
        "not shown": "Whether the methods err at the same places is not shown.",
        "differ": "Half of the methods or more err at other places: both patterns are more than noise, and not alike.",
    },
    "order": {
        "alike": "The methods rank alike.",
        "not shown": "That the methods rank alike is not shown: chance could turn their order over.",
        "differ": "Two methods or more change places, significantly on both.",
    },
}
TOPICS = {"level": "How large", "pattern": "Where", "order": "Which method"}


def names_of(found: Found) -> tuple[str, str]:
    """Return what the two captures are called, as HTML."""
    names = []
    for kind in ("real", "twin"):
        one = found["captures"][kind]
        names.append(f"{escape(one['name'])} <small>{escape(one['kind'])}</small>")
    return names[0], names[1]


def badge_of(answer: str) -> str:
    """Return an answer as a word in a coloured frame."""
    return f'<span class="badge {LEVELS[answer]}">{answer}</span>'


def carried_section(found: Found) -> str:
    """Return what the sigmas hold, for each capture."""
    rows = []
    for kind, title in zip(("real", "twin"), names_of(found), strict=True):
        one = found["captures"][kind]["carried"]
        if not one.get("moves"):
            rows.append((title, "blocks of pixels", escape(one.get("why", "nothing"))))
            continue
        moved = [
            words.format(number(one[key], decimals, unit))
            for key, words, decimals, unit in (
                ("direction_sigma_deg", "light directions {}", 2, "°"),
                ("pose_sigma_deg", "registration {}", 2, "°"),
                ("pose_sigma_mm", "and {}", 2, "mm"),
            )
            if is_number(one.get(key))
        ]
        if is_number(one.get("intensity_sigma")):
            moved.insert(1, f"light intensities {percent(one['intensity_sigma'], 1)}")
        text = f"{', '.join(moved)}: solved again {number(one['moves'])} times at {number(one['pixels'])} pixels"
        if one.get("not_carried"):
            text += f"; not for {escape(', '.join(one['not_carried']))}, which could not be run again"
        rows.append((title, "blocks of pixels", text))
    lead = "Sigmas are medians of those in lights.json, and those in pose.json."
    return section("carried", "What the sigmas hold", table(("capture", "drawn", "moved by one sigma"), rows), lead)


def how_to_read_section() -> str:
    """Return what the page's words mean."""
    words = (
        (
            "Sigma",
            "one standard deviation: over draws of square blocks of pixels, since neighbours err together, and over "
            "movements of lights and registration by their own sigmas. A wrong model of light or surface is not in it.",
        ),
        (
            "Fail alike",
            "the errors lie at the same places and rank the methods alike, and are not shown to differ in size.",
        ),
        (
            "Differ",
            "one of the three questions is answered so. If both captures came from one source, sizes would be said to "
            "differ in at most one comparison of twenty, and so would orders.",
        ),
        ("Not shown", "neither of the two could be shown. It is no proof of likeness."),
        (
            "Same places",
            f"alike: Pearson's correlation is above {ALIKE_FROM:g} with its whole interval. Other places: below it "
            f"with its whole interval, though more than {100 * STRUCTURED:.0f} % of both maps is no pixel's own noise. "
            "Maps that are mostly noise have no places to compare.",
        ),
        (
            "Order",
            "two methods contradict when each capture alone shows their order, and the two orders are opposite.",
        ),
    )
    listed = "".join(f"<dt>{escape(term)}</dt><dd>{escape(text)}</dd>" for term, text in words)
    return section("how-to-read", "How to read this page", f"<dl>{listed}</dl>")
