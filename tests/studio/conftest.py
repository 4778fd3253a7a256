"""A client that nobody sits at, windows of the studio for it, and a browser's window at a studio."""

import contextlib
import io
import threading
from types import SimpleNamespace

import pytest

from studio.editor import edits
from studio.server import Studio
from studio.studio_state import StudioState
from studio.workspace import Workspace
from tests.studio.visitor import Visitor


@contextlib.contextmanager
def unvisited_server():
    """A server of viser's that no browser comes to."""
    import viser

    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        yield server
        server.stop()


@pytest.fixture(scope="session")
def viser_server():
    """One for all tests with a single client."""
    with unvisited_server() as server:
        yield server


@pytest.fixture
def nobodies():
    """Return what makes clients that nobody sits at, each with panels of its own."""
    with contextlib.ExitStack() as servers:
        yield lambda number: Nobody(servers.enter_context(unvisited_server()), number)


def at_once(answer):
    """Do what a coroutine does; it may wait for nothing. Playwright's own loop may be running in this thread."""
    if answer is not None:
        with pytest.raises(StopIteration):
            answer.send(None)


class Nobody:
    """A client that nobody sits at: viser's own inputs and view, used as its server uses them for a browser."""

    def __init__(self, server, number=1):
        self.client_id, self._server, self.gui, self.scene = number, server, server.gui, server.scene
        self.camera, self.told = SimpleNamespace(fov=0.8, aspect=1.5), []
        self.atomic = server.atomic

    def add_notification(self, title, text, **look):
        self.told.append(f"{title}: {text}")

    def inputs(self, label):
        """Return the inputs and buttons of these words, in the order in which they were made."""
        handles = self.gui._gui_input_handle_from_uuid.values()
        return [one for one in handles if (getattr(one, "label", None) or "").partition(":")[0] == label]

    def input(self, label):
        """Return the one of these words that was made last."""
        return self.inputs(label)[-1]

    def shown(self, kind="content"):
        """Return what all panels show: their texts, or their pictures, which are of the kind `image`."""
        panels = list(self.gui._container_handle_from_uuid.values())
        return [getattr(one, kind) for panel in panels for one in panel._children.values() if hasattr(one, kind)]

    def says(self, handle, value=True):
        """Change an input, or press a button, given itself or its words."""
        handle = self.input(handle) if isinstance(handle, str) else handle
        handle._impl.value = value
        for call in handle._impl.update_cb:
            at_once(call(SimpleNamespace(client=self, client_id=self.client_id, target=handle)))

    def clicks(self, handle, **event):
        """Click something in the view."""
        for entry in list(handle._impl.click_cb):
            at_once(entry.callback(SimpleNamespace(client=self, **event)))

    def drags(self, handle, *places):
        """Drag something in the view from the first of these places over the others, and let it go."""
        for phase, place in [("start", places[0]), *(("update", place) for place in places[1:]), ("end", places[-1])]:
            event = SimpleNamespace(client=self, phase=phase, start_position=places[0], end_position=place)
            for entry in list(handle._impl.drag_cb):
                at_once(entry.callback(event))

    def seen(self, name):
        """Return what stands in the view under a name."""
        return self.scene._handle_from_node_name[name]

    def sends(self, label, name, content):
        """Send a file by a button."""
        self.says(label, SimpleNamespace(name=name, content=content))


@pytest.fixture
def run_studio():
    """Return what makes a studio at a folder; all are closed in the end."""
    running = []

    def run(root, **state):
        running.append(Studio(Workspace.at(root), port=0, state=StudioState(**state)))
        return running[-1]

    yield run
    for one in running:
        one.close()


@pytest.fixture
def nobody(viser_server):
    """Return what makes a client that nobody sits at."""
    yield lambda number=1: Nobody(viser_server, number)
    viser_server.gui.reset()
    viser_server.scene.reset()


@pytest.fixture
def no_preview():
    """A preview that draws nothing."""
    return SimpleNamespace(request=lambda *rest: None)


@pytest.fixture
def furnish(monkeypatch):
    """Return what shows rows and views on a window, which looks again often; all are closed in the end."""
    monkeypatch.setattr("studio.window.EVERY_S", 0.05)
    windows = []

    def put(window, rows, *views):
        windows.append(window)
        window.show(rows, views)
        return window

    yield put
    for window in windows:
        window.close()
        window.wait()


@pytest.fixture
def settle():
    """Return what waits until a window has done all that was said so far."""

    def wait(window):
        done = threading.Event()
        window.post(done.set)
        assert done.wait(60), "the window is stuck"

    return wait


@pytest.fixture
def say(settle):
    """Return what says things in a window, each done before the next: a button's words, or an input's and its value."""

    def said(window, *things):
        for thing in things:
            window.client.says(*((thing,) if isinstance(thing, str) else thing))
            settle(window)

    return said


def small_document(**tables):
    """Return a new scene's document with these values, table by table."""
    document = edits.start_document()
    for key, change in tables.items():
        for name, value in change.items():
            document = edits.with_value(document, (key, name), value)
    return document


@pytest.fixture
def visit(chromium):
    """Return what opens a window at a studio; all are closed in the end."""
    windows = []

    def opened(studio, ready="Load model"):
        windows.append(Visitor(chromium, studio, ready))
        return windows[-1]

    yield opened
    for one in windows:
        if not one.page.is_closed():
            one.page.close()
