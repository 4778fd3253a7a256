"""Example reports as pages of the documentation: docs/gallery.md, pictures of their first screens, and the reports.

    make gallery        # .venv/bin/python -m docs.write_gallery [--out out/gallery]

Each session is taken the whole way, as `rgbn process` does, into the folder --out; what is current is not done again.
The reports themselves go to docs/_gallery, which git leaves out and `make docs` takes into the site. Sessions of
others' data are left out where the data are not there.
"""

import argparse
import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import ROOT, SHARED
from compare.report.facts import all_warnings
from compare.report.page import LEVELS
from compare.report.verdict import verdict
from rgbn.examples import fixture_folder

DOCS = ROOT / "docs"
WEBGL = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
"""Drawn by software."""
SCREEN = {"width": 1280, "height": 800}
HEAD = """# Example reports

Each picture is a report's first screen; *the whole page* has its viewer, too. How to read them:
[Read the report](guide/read-the-report.md).
"""


@dataclass(frozen=True)
class Example:
    """One report of the gallery.

    make: Writes the session into an empty folder, given the folder of all outputs; returns what is processed.
    """

    name: str
    title: str
    what: str
    make: Callable[[Path, Path], Path]


def _without_scan(place: Path, outputs: Path) -> Path:
    """Copy the demo's session, but for its scan."""
    shutil.copytree(fixture_folder(), place, dirs_exist_ok=True)
    text = (place / "session.toml").read_text()
    (place / "session.toml").write_text(text[: text.index("[object]")])
    return place


def _other_lights(place: Path, outputs: Path) -> Path:
    """Copy the demo's photographs and true normals; each flash gets the direction of the next one."""
    shutil.copytree(fixture_folder(), place, dirs_exist_ok=True)
    text = (place / "session.toml").read_text()
    count, *rows = (outputs / "demo" / "lights.lp").read_text().splitlines()
    names, vectors = zip(*(row.split(" ", 1) for row in rows), strict=True)
    shifted = [f"{name} {vector}" for name, vector in zip(names, (*vectors[1:], vectors[0]), strict=True)]
    (place / "lights.lp").write_text("\n".join([count, *shifted]) + "\n")
    truth = np.load(place / "truth.npz")
    np.save(place / "normals.npy", np.where(truth["mask"][..., None], truth["normals"], np.nan).astype(np.float32))
    end = '[lights]\nfile = "lights.lp"\n\n[object]\nnormals = "normals.npy"\n'
    (place / "session.toml").write_text(text[: text.index("[[spheres]]")] + end)
    return place


def _given(folder: Path) -> Callable[[Path, Path], Path]:
    return lambda place, outputs: folder


EXAMPLES = (
    Example(
        "demo", "All is well", "The session of `make demo`: twelve flashes, three balls, a scan.",
        _given(fixture_folder()),
    ),
    Example(
        "bunny", "A glossy object, rendered by another program",
        "A glazed rabbit beside balls, rendered by a program that shares no code with this one.",
        _given(SHARED / "sessions" / "bunny"),
    ),
    Example(
        "cat", "A capture of others",
        "`catPNG` of the [DiLiGenT benchmark](https://doi.org/10.1109/CVPR.2016.403): lights and true normals are "
        "given, nothing tells how well they are known.",
        _given(SHARED / "real" / "diligent" / "catPNG"),
    ),
    Example(
        "photographs", "No scan", "The demo's photographs and balls without the scan: no error is known.", _without_scan
    ),
    Example(
        "lights", "The wrong lights",
        "The demo's photographs with a light file in which each flash has the direction of the next one.",
        _other_lights,
    ),
)  # fmt: skip


def processed(example: Example, outputs: Path) -> Path | None:
    """Return the output folder of an example; None where its data are not there."""
    from lab.options import Settings
    from lab.run import run_session

    place = outputs / "sessions" / example.name
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    session = example.make(place, outputs)
    if not session.is_dir():
        print(f"left out: {example.name}, {session.name} is not there")
        return None
    out = outputs / example.name
    run_session(session, "compare", out=out, said=Settings(truth=session if example.name == "demo" else None))
    return out


def told(example: Example, out: Path) -> str:
    """Return an example's part of the page."""
    summary = json.loads((out / "summary.json").read_text())
    said, count = LEVELS[verdict(summary)[0].level].capitalize(), len(all_warnings(summary))
    return f"""## {example.title}

{example.what}

![{said}](gallery/{example.name}.webp)

<p>{said}. <a href="{example.name}.html">The whole page</a>, {(out / "report.html").stat().st_size / 1e6:.1f} MB; \
{count or "no"} warning{"s" if count != 1 else ""}.</p>
"""


@contextmanager
def chromium() -> Iterator[Any]:
    """Yield playwright's browser. RGBN_CHROMIUM: its path; else the system's."""
    from playwright.sync_api import sync_playwright

    path = os.environ.get("RGBN_CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    with (
        sync_playwright() as playwright,
        closing(playwright.chromium.launch(executable_path=path, args=WEBGL)) as browser,
    ):
        yield browser


def photographed(reports: dict[str, Path]) -> None:
    """Write pictures of the reports' first screens into docs/gallery."""
    import io

    from PIL import Image

    (DOCS / "gallery").mkdir(exist_ok=True)
    with chromium() as browser:
        for name, path in reports.items():
            page = browser.new_page(viewport=SCREEN, reduced_motion="reduce")
            page.goto(path.resolve().as_uri())
            page.wait_for_timeout(500)
            Image.open(io.BytesIO(page.screenshot())).convert("RGB").save(
                DOCS / "gallery" / f"{name}.webp", quality=80, method=6
            )
            page.close()


def main() -> None:
    """Make sessions, reports, pictures and the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "gallery")
    outputs = parser.parse_args().out
    done = {example: out for example in EXAMPLES if (out := processed(example, outputs)) is not None}
    site = DOCS / "_gallery"
    shutil.rmtree(site, ignore_errors=True)
    site.mkdir()
    for example, out in done.items():
        shutil.copy(out / "report.html", site / f"{example.name}.html")
    photographed({example.name: out / "report.html" for example, out in done.items()})
    (DOCS / "gallery.md").write_text("\n".join([HEAD, *(told(example, out) for example, out in done.items())]))


if __name__ == "__main__":
    main()
