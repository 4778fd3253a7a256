"""A browser's window at the studio, and where things stand on its screen, in Chromium."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.conftest import ROOT

PATIENCE_S = 240
"""For what comes in the end, however busy the machine is."""
STUCK_S = 60
"""After which a page is loaded again that does not show a button."""
SHOTS = ROOT / "out" / "studio"
"""Where screenshots are left to be looked at."""
VIEW = {"width": 1060, "height": 560}
FEWER_FRAMES = """
const draw = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = then => setTimeout(() => draw(then), 100);
window.cancelAnimationFrame = number => clearTimeout(number);
"""
"""Ten frames a second at most: drawing all the time, a software renderer takes a core from what it waits for."""
HEARD = """
window.heard = [];
const hear = event => window.heard.push(event.target.closest('button')?.textContent.trim() ?? '');
document.addEventListener('click', hear, true);
"""
"""The words of the buttons that were pressed: a press between two layouts of a page arrives at none."""


class Visitor:
    """A browser's window at a studio, and the window that it works on.

    interactions: What a person did so far: presses, tabs, texts typed, clicks in the view.
    """

    def __init__(self, chromium, studio, ready):
        self.asked, self.drawn, self.interactions, self._studio = [], None, 0, studio
        self.page = chromium.new_page(viewport=VIEW)
        self.page.add_init_script(FEWER_FRAMES + HEARD)
        self.page.set_default_timeout(1000 * PATIENCE_S)
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("websocket", lambda socket: self.asked.append(socket.url))
        self.page.goto(studio.address)
        self.button(ready).wait_for()

    @property
    def window(self):
        """The window of the area that is shown."""
        return self._studio.window

    def reload(self, ready):
        """Load the page again."""
        before = self.window
        self.page.reload()
        self.until(lambda: self.window not in (None, before), "a new window")
        self.button(ready).wait_for()
        self.settle()

    def settle(self):
        """Wait until the window has done what it was told, and that is drawn."""
        done = []
        self.window.post(lambda: done.append(True))
        self.until(lambda: done, "the window is at rest")
        self.frames(4)

    def click(self, point):
        """Click a point (3,) of the view."""
        self.settle()
        self.interactions += 1
        self.page.mouse.click(*self.on_screen(point))

    def fill(self, label, value):
        """Type into an input, and wait until it is said.

        Of what changes within 50 ms, in whatever input, viser's page sends the last alone. No person is that fast.
        """
        self.interactions += 1
        self.page.wait_for_timeout(200)
        box = self.page.get_by_label(label, exact=True)
        box.fill(str(value))
        box.press("Tab")
        self.page.wait_for_timeout(200)
        self.settle()

    def button(self, name):
        """Return a button by its words."""
        return self.page.get_by_role("button", name=name, exact=True)

    def press(self, name):
        """Press a button until the page heard it: a press on a page that is still being laid out is lost.

        By force: a software renderer may take seconds for two frames that show it. Where the button does not come, the
        page is loaded again: on a machine that stands still for 10 s, viser's page takes messages out of their order.
        """
        self.interactions += 1
        if not self.is_soon(self.button(name).count, STUCK_S):
            print(f"{name}: not there within {STUCK_S} s; the page says: {self.page.inner_text('body')}")
            self.reload(name)
            if self.drawn is not None:
                self._listen()
        before = self.page.evaluate("heard.length")
        for _ in range(PATIENCE_S):
            self.button(name).click(force=True)
            if name in self.page.evaluate("before => heard.slice(before)", before):
                return
            self.page.wait_for_timeout(1000)
        pytest.fail(f"{name}: not pressed within {PATIENCE_S} s; pressed: {self.page.evaluate('heard')[before:]}")

    def tab(self, name):
        """Turn to a tab. Pressed again where the page was still being laid out under the first press."""
        self.interactions += 1
        tab = self.page.get_by_role("button", name=re.compile(rf"^{name}( [✓⚠].*)?$")).last
        for _ in range(PATIENCE_S):
            tab.click(force=True)
            for _ in range(20):
                if self.window.tab == name:
                    return
                self.page.wait_for_timeout(50)
        pytest.fail(f"{name}: the tab does not open")

    def see(self, text):
        """Wait until a text is there."""
        self.page.get_by_text(text).first.wait_for()

    def shows(self, value):
        """Wait until an input has a value, and the frame after that is drawn: what came with it is there too."""
        self.page.wait_for_function("v => [...document.querySelectorAll('input')].some(i => i.value == v)", arg=value)
        self.frames(3)

    def frames(self, count):
        """Wait until so many frames are drawn."""
        for _ in range(count):
            self.page.evaluate("() => new Promise(done => requestAnimationFrame(() => done()))")

    def preview(self, change):
        """Make a change, and return the previews that come of it, the refined one last."""
        self.see("refined")
        self.drawn, quiet = [], self._listen()
        change()
        self.until(lambda: self.drawn and self.drawn[-1].is_refined, "a refined picture")
        quiet()
        drawn, self.drawn = self.drawn, None
        return drawn

    def _listen(self):
        """Note the previews that the window shows; return what ends that."""
        window, show = self.window, self.window.show_preview
        window.show_preview = lambda one: (self.drawn.append(one), show(one))
        return lambda: setattr(window, "show_preview", show)

    def send(self, button, path):
        """Send a file by a button."""
        with self.page.expect_file_chooser() as chooser:
            self.press(button)
        chooser.value.set_files(path)

    def is_soon(self, condition, within_s=PATIENCE_S):
        """Return whether something is so in the end; the browser goes on meanwhile."""
        for _ in range(within_s * 20):
            if condition():
                return True
            self.page.wait_for_timeout(50)
        return False

    def until(self, condition, what):
        """Wait until something is so."""
        if not self.is_soon(condition):
            pytest.fail(f"{what}: not within {PATIENCE_S} s; pressed: {self.page.evaluate('heard')}")

    def on_screen(self, point):
        """Return where on the page a point (3,) of the 3-D view is seen, px."""
        camera, box = self.window.client.camera, self.page.locator("canvas").first.bounding_box()
        turned = Rotation.from_quat(camera.wxyz, scalar_first=True)
        x, y, z = turned.inv().apply(np.asarray(point, float) - camera.position)
        focal = box["height"] / 2 / np.tan(camera.fov / 2)
        return np.array([box["x"] + box["width"] / 2 + focal * x / z, box["y"] + box["height"] / 2 + focal * y / z])

    def drag(self, start, end):
        """Press, move in steps as a hand does, let go."""
        mouse = self.page.mouse
        mouse.move(*(start - [3, 3]))
        self.frames(2)
        mouse.move(*start)
        # What lies under the hand is looked up in the next frame.
        self.frames(3)
        mouse.down()
        self.frames(1)
        for part in np.linspace(0, 1, 7)[1:]:
            mouse.move(*(start + part * (end - start)))
            self.frames(1)
        mouse.up()

    def keep(self, name):
        """Leave a screenshot to be looked at."""
        SHOTS.mkdir(parents=True, exist_ok=True)
        self.page.screenshot(path=SHOTS / f"{name}.png")
