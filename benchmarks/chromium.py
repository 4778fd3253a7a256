"""Headless Chromium for what measures or photographs a page."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
"""With WebGL, by software."""
SCREEN = {"width": 1280, "height": 800}


@contextmanager
def chromium() -> Iterator[Any]:
    """Yield playwright's browser. RGBN_CHROMIUM: its path; else the system's."""
    from playwright.sync_api import sync_playwright

    path = os.environ.get("RGBN_CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        try:
            yield browser
        finally:
            browser.close()
