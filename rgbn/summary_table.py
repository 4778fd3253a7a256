"""The end of a run, for people at a terminal: the figures and the warnings."""

import json
from collections.abc import Iterable, Iterator, Sequence
from typing import Any


def number_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]], *, words: int = 0) -> Any:
    """Return a table for a terminal, whose first columns, `words`, are texts and the others numbers."""
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for place, head in enumerate(heads):
        table.add_column(head, justify="left" if place < words else "right")
    for row in rows:
        table.add_row(*row)
    return table


def tell(summary: dict[str, Any], as_json: bool) -> None:
    """Print a session's figures as JSON, or as a table with the warnings below."""
    if as_json:
        print(json.dumps(summary, indent=1))
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    table = Table(title=Text(summary["name"]), show_header=False, title_justify="left")
    table.add_column(style="bold")
    table.add_column()
    for label, text in _rows(summary):
        table.add_row(label, text)
    console.print(table)
    methods = summary["compare"].get("methods") or {}
    if any(row.get("real") for row in methods.values()):
        heads = ("method", "frames", "mean", "median", "under 5", "under 10")
        console.print(number_table("Angular error, degrees", heads, _error_rows(methods), words=2))
    if check := summary.get("truth_check"):
        known = [(row["text"], f"{row['value']:.3g} {row['unit']}") for row in check.values()]
        console.print(number_table("Against the known truth", ("figure", "value"), known, words=1))
    for warning in summary["warnings"]:
        # The texts name keys such as [camera], which rich would take for its markup.
        console.print(Text("warning ", style="yellow") + Text(f"({warning['step']}) {warning['text']}"))


def _rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    rows = []
    if capture := summary["capture"]:
        ambient = ", ambient frame" if capture["ambient"] else ""
        rows.append(("frames", f"{capture['frames']} of {capture['width']} x {capture['height']} px{ambient}"))
    if lights := summary["calibrate"]:
        sigma = lights["direction_sigma_deg_median"]
        known = f", direction sigma {sigma:.2f} degrees" if sigma is not None else ""
        # Only `align` knows where the object is.
        place = "" if "align" in summary["seconds"] else "; so far as seen from amid the balls, not from the object"
        rows.append(("lights", f"{lights['model']}, from {lights['spheres']} balls{known}{place}"))
    if (test := summary["self_test"]) and test["calibrated"]:
        inside = ", ".join(
            f"{test[key]:.0%} of {what}"
            for what in ("directions", "positions", "intensities")
            if test.get(key := f"{what}_inside_95") is not None
        )
        found = [f"directions {test['direction_error_deg_median']:.2f} degrees off"]
        if (position := test.get("position_error_percent_median")) is not None:
            found.append(f"positions {position:.1f} %")
        if (intensity := test.get("intensity_error_percent_rms")) is not None:
            found.append(f"intensities {intensity:.1f} %")
        rows.append(("self-test", f"{', '.join(found)}; inside their 95 % region: {inside}"))
    if (scan := summary["align"]) and scan.get("residual_px") is not None:
        rows.append(("scan", f"residual {scan['residual_px']:.2f} px, sigma {scan['sigma_deg']:.3f} degrees"))
    if twin := summary["twin"]:
        rows.append(("twin", f"engine {twin['engine']}, {twin['seconds']:.0f} s"))
    rows.append(("seconds", f"{sum(summary['seconds'].values()):.1f}"))
    return rows


def _error_rows(methods: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    for name, row in methods.items():
        for label in ("real", "twin"):
            if found := row.get(label):
                degrees = (f"{found[key]:.2f}" for key in ("mean_deg", "median_deg"))
                yield name, label, *degrees, *(f"{found[key]:.0%}" for key in ("under_5_deg", "under_10_deg"))
