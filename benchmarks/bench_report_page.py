"""Faults of the report's page in headless Chromium, and how soon it answers; into docs/evidence/studio.md.

    .venv/bin/python -m benchmarks.bench_report_page FOLDER... [--write]

FOLDERs are output folders with a report.html, such as those of `make gallery`. Each report is opened from its file on a
desktop (1280 x 800) and a phone (390 x 844), light and dark, all of it unfolded: messages of the console, the sum of
layout shifts, faults that axe-core finds. Then the pointer goes to pixels of the object, and clicks: from the event to
the value that is read, to the drawn samples.
"""

import argparse
import importlib.resources
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.chromium import SCREEN, chromium
from benchmarks.pages import put

DOCS = Path(__file__).resolve().parents[1] / "docs" / "evidence"
PHONE = {"width": 390, "height": 844}
PIXELS = 40
SHIFTS = """new Promise((done) => { let sum = 0;
new PerformanceObserver((list) => list.getEntries().forEach((entry) => { sum += entry.value; }))
  .observe({ type: "layout-shift", buffered: true }); setTimeout(() => done(sum), 500); })"""
ANSWER = """([kind, x, y, place]) => {
  const told = document.getElementById(place), canvas = document.getElementById("viewer-canvas");
  const before = told.dataset.pixel, how = { clientX: x, clientY: y, bubbles: true, pointerId: 1, isPrimary: true };
  const event = (name) => new PointerEvent(name, how);
  const start = performance.now();
  return new Promise((done) => {
    const seen = () => done(told.dataset.pixel === before ? null : performance.now() - start);
    new MutationObserver((_, watch) => { watch.disconnect(); seen(); }).observe(told, { attributes: true });
    if (kind === "move") canvas.dispatchEvent(event("pointermove"));
    else for (const name of ["pointerdown", "pointerup", "click"]) canvas.dispatchEvent(event(name));
    setTimeout(() => done(null), 3000);
  });
}"""
"""Milliseconds from an event to the text that it changes; null where it changes none."""


def faults(browser: Any, report: Path) -> dict[str, float]:
    """Return how many messages, how much shift, and how many faults, over sizes and colour schemes."""
    axe = (importlib.resources.files("axe_playwright_python") / "axe.min.js").read_text("utf-8")
    found = {"messages": 0.0, "shifts": 0.0, "axe": 0.0}
    for size in (SCREEN, PHONE):
        for scheme in ("light", "dark"):
            page, told = browser.new_page(viewport=size, color_scheme=scheme, reduced_motion="reduce"), []
            page.on("console", lambda message, into=told: into.append(message.text))
            page.on("pageerror", lambda error, into=told: into.append(str(error)))
            page.goto(report.as_uri())
            found["shifts"] += page.evaluate(SHIFTS)
            page.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
            page.evaluate(axe)
            found["axe"] += page.evaluate("axe.run().then((told) => told.violations.length)")
            found["messages"] += len(told)
            page.close()
    return found


def answers(browser: Any, report: Path) -> dict[str, float]:
    """Return median milliseconds from the pointer to the value, and from a click to the samples; of the first click.

    The first one decodes the photographs of all lights.
    """
    page = browser.new_page(viewport=SCREEN, reduced_motion="reduce")
    page.goto(report.as_uri())
    page.locator("#viewer-canvas").scroll_into_view_if_needed()
    page.wait_for_timeout(1500)
    box = page.locator("#viewer-canvas").bounding_box()
    rng, spent = np.random.default_rng(5), {"move": [], "click": []}
    places = {"move": "viewer-values", "click": "viewer-samples"}
    for x, y in rng.uniform(0.3, 0.7, (PIXELS, 2)):
        for kind, place in places.items():
            at = [kind, box["x"] + x * box["width"], box["y"] + y * box["height"], place]
            if (milliseconds := page.evaluate(ANSWER, at)) is not None:
                spent[kind].append(milliseconds)
    page.close()
    assert min(map(len, spent.values())) > PIXELS / 2, "the viewer did not answer"
    return {kind: float(np.median(values)) for kind, values in spent.items()} | {"first": spent["click"][0]}


def table(folders: Iterable[Path]) -> str:
    """Return a row for each report."""
    lines = [
        "| report | photographs | MB | console messages | layout shifts | axe-core's faults | pointer to value, ms | "
        "click to samples, ms | the first click, ms |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    with chromium() as browser:
        for folder in folders:
            report = folder.resolve() / "report.html"
            frames = (json.loads((folder / "summary.json").read_text()).get("capture") or {}).get("frames")
            found, spent = faults(browser, report), answers(browser, report)
            lines.append(
                f"| {folder.name} | {frames} | {report.stat().st_size / 1e6:.1f} | {found['messages']:.0f} | "
                f"{found['shifts']:g} | {found['axe']:.0f} | {spent['move']:.1f} | {spent['click']:.1f} | "
                f"{spent['first']:.0f} |"
            )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the table; with --write put it into docs/evidence/studio.md."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    text = table(arguments.folders)
    text += f"\nMeasured on {os.cpu_count()} cores by `benchmarks/bench_report_page.py`; medians of {PIXELS} pixels.\n"
    print(text)
    if arguments.write:
        put(DOCS / "studio.md", "report", text)


if __name__ == "__main__":
    main()
