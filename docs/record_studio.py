"""Record the studio from a folder of photographs to the report: a minute, as one animated picture for the README.

    .venv/bin/python -m docs.record_studio [--out docs/guide/studio.webp]

The studio is the real one, in headless Chromium, on the photographs and the scan of the demo's session without its
session.toml. What is shown is held as long as it takes to read it: the steps' own minutes are left out, and said.
"""

import argparse
import io
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

from docs.write_gallery import SCREEN, chromium
from rgbn.examples import fixture_folder
from studio.server import Studio
from studio.workspace import Workspace

PATIENCE_MS = 1_200_000
POINTER = """([x, y, text]) => {
  let dot = document.getElementById("record-dot"), told = document.getElementById("record-told");
  if (!dot) {
    dot = Object.assign(document.createElement("div"), { id: "record-dot" });
    told = Object.assign(document.createElement("div"), { id: "record-told" });
    dot.style.cssText = "position:fixed;z-index:99;width:22px;height:22px;margin:-11px;border-radius:50%;" +
      "background:#e69f0099;border:2px solid #a33c00;pointer-events:none";
    told.style.cssText = "position:fixed;z-index:98;left:0;bottom:0;padding:6px 14px;background:#12416b;" +
      "font:600 17px system-ui,sans-serif;color:#fff;pointer-events:none";
    document.body.append(dot, told);
  }
  dot.style.display = x === null ? "none" : "block";
  dot.style.left = `${x}px`; dot.style.top = `${y}px`; told.textContent = text;
}"""


class Recording:
    """Frames of a page, each with how long it is shown, ms."""

    def __init__(self, page: Any) -> None:
        self.page, self.frames, self.text = page, list[tuple[bytes, int]](), ""

    def say(self, text: str) -> None:
        """Write what is done at the lower edge."""
        self.text = text

    def hold(self, milliseconds: int, place: tuple[float, float] | None = None) -> None:
        """Keep what is seen for so long, the pointer at a place."""
        self.page.evaluate(POINTER, [*(place or (None, None)), self.text])
        self.page.wait_for_timeout(100)
        self.frames.append((self.page.screenshot(), milliseconds))

    def press(self, target: Any, after_ms: int = 1500) -> None:
        """Go to something, press it, and keep what comes."""
        target.wait_for(timeout=PATIENCE_MS)
        target.scroll_into_view_if_needed()
        box = target.bounding_box()
        self.hold(900, (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2))
        target.click(force=True)
        self.page.wait_for_timeout(after_ms)

    def write(self, path: Path, quality: int) -> None:
        """Write all frames as an animated WebP that begins again."""
        from PIL import Image

        images = [Image.open(io.BytesIO(png)).convert("RGB") for png, _ in self.frames]
        times = [time for _, time in self.frames]
        images[0].save(path, save_all=True, append_images=images[1:], duration=times, loop=0, quality=quality, method=6)


def record(page: Any, address: str) -> Recording:
    """Go from the folder to the report."""
    button = lambda name: page.get_by_role("button", name=name, exact=True)  # noqa: E731
    # Behind a tab's name stand a tick or its warnings; the areas' names come before.
    tab = lambda name: page.get_by_role("button", name=re.compile(rf"^{name}( [✓⚠].*)?$")).last  # noqa: E731
    page.set_default_timeout(PATIENCE_MS)
    page.goto(address)
    button("bumpy/").wait_for()
    # What viser says of a machine without a graphics card would lie over the view.
    page.add_style_tag(content=".mantine-Notifications-root { display: none }")
    shown = Recording(page)
    shown.say("A folder of photographs, and a scan")
    shown.hold(2500)
    shown.press(button("bumpy/"))
    shown.hold(1500)
    shown.press(button("New session here"))
    button("Write session.toml").wait_for()
    page.wait_for_timeout(3000)
    shown.say("Two diameters are typed")
    shown.hold(2500)
    for label, value in (("chrome, mm", "100"), ("white, mm", "90")):
        box = page.get_by_label(label, exact=True)
        box.fill(value)
        box.press("Tab")
        page.wait_for_timeout(1000)
        at = box.bounding_box()
        shown.hold(1800, (at["x"] + 30, at["y"] + at["height"] / 2))
    shown.press(button("Write session.toml"))
    button("Run everything").wait_for()
    page.wait_for_timeout(2500)
    shown.say("Balls, camera and scan are found")
    shown.hold(3500)
    shown.say("Everything runs: one to two minutes, left out here")
    shown.hold(2000)
    shown.press(button("Run everything"))
    report = page.frame_locator("#studio-report")
    for _ in range(3):
        page.wait_for_timeout(8000)
        shown.hold(1500)
    report.locator(".first").wait_for(timeout=PATIENCE_MS)
    page.wait_for_timeout(2500)
    shown.say("The verdict: how good, why, what to do")
    shown.hold(6000)
    frame = next(one for one in page.frames if "/report/" in one.url)
    for anchor, text in (
        ("viewer", "Photograph and error, wiped over each other"),
        ("errors", "The errors of each method"),
    ):
        shown.say(text)
        frame.evaluate(f"location.hash = '{anchor}'")
        page.wait_for_timeout(1500)
        shown.hold(3500)
    for name, text in (
        ("Capture", "The photographs, as they were audited"), ("Balls", "The balls and their outlines"),
        ("Lights", "The flashes around the object"),
        ("Scan", "The outline of the registered scan"), ("Solve", "The normals"), ("Verdict", "The verdict again"),
    ):  # fmt: skip
        shown.say(text)
        shown.press(tab(name), 4000)
        shown.hold(3000)
    return shown


def main() -> None:
    """Record, and say how long and how large it is."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=Path, default=Path("docs") / "guide" / "studio.webp")
    parser.add_argument("--quality", type=int, default=60)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        for part in ("raw", "scan"):
            shutil.copytree(fixture_folder() / part, Path(folder) / "bumpy" / part)
        studio = Studio(Workspace.at(Path(folder)), port=0)
        try:
            shown = record(browser.new_page(viewport=SCREEN), studio.address)
        finally:
            studio.close()
    shown.write(arguments.out, arguments.quality)
    seconds = sum(time for _, time in shown.frames) / 1000
    print(f"{arguments.out}: {len(shown.frames)} frames, {seconds:.0f} s, {arguments.out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
