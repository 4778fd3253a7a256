"""Who may speak to the studio, one window at a time, and what is given out."""

import http.client
import threading
from pathlib import Path

import pytest
from websockets.asyncio import server as served
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from scene.errors import SceneError
from studio.editor import edits
from studio.server import ELSEWHERE, Studio
from studio.session.folder import Review
from studio.studio_state import StudioState
from studio.workspace import Workspace

pytestmark = [pytest.mark.render]


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    running = Studio(Workspace.at(tmp_path_factory.mktemp("bench")), port=0, state=StudioState(area="Scene"))
    yield running
    running.close()


def asked(studio, path="/", **headers):
    connection = http.client.HTTPConnection(studio.address.removeprefix("http://"), timeout=60)
    try:
        connection.putrequest("GET", path, skip_host="Host" in headers)
        for name, values in headers.items():
            for value in values if isinstance(values, list) else [values]:
                connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, answer.headers.get("Content-Security-Policy", ""), answer.read()
    finally:
        connection.close()


def test_only_its_own_page_may_speak_to_it(studio):
    """A page on the web that names the loopback address, or a name that was made to lead there, is turned away."""
    own = studio.address.removeprefix("http://")
    port = int(own.rpartition(":")[2])
    for headers in (
        {},
        {"Origin": f"http://{own}"},
        {"Host": "localhost:9", "Origin": "http://localhost:9"},
    ):
        status, _, page = asked(studio, **headers)
        assert (status, b"rgbn studio" in page) == (200, True), headers
    stranger, neighbour = "http://example.org", f"http://127.0.0.1:{port + 1}"
    for origin in (stranger, neighbour, f"https://{own}", "null", "", [f"http://{own}", stranger]):
        assert asked(studio, Origin=origin)[0] == 403, origin
    for host in (f"example.org:{port}", f"127.0.0.1.example.org:{port}", "", [own, own]):
        assert asked(studio, Host=host)[0] == 403, host
    for path in ("/../../etc/passwd", "/%2e%2e/x", "/no/such/page", "//x"):
        assert asked(studio, path)[0] == 404, path
    with pytest.raises(InvalidStatus, match="403"):
        connect(studio.address.replace("http", "ws"), origin="http://example.org", proxy=None)


def test_it_listens_on_the_loopback_address_alone_and_a_taken_port_is_told(studio, tmp_path):
    assert studio.address.startswith("http://127.0.0.1:")
    port = int(studio.address.rpartition(":")[2])
    sockets = Path("/proc/net/tcp").read_text().splitlines()
    listening = [line.split() for line in sockets if f":{port:04X} 00000000:0000 0A" in line]
    assert [row[1] for row in listening] == [f"0100007F:{port:04X}"]
    with pytest.raises(SceneError, match=f"--port {port}: cannot be used"):
        Studio(Workspace.at(tmp_path), port=port)


def test_where_viser_serves_by_another_way_the_studio_does_not_begin(monkeypatch, tmp_path):
    """Rather than stand open."""
    serve = served.serve
    monkeypatch.setattr(served, "serve", serve)
    monkeypatch.setattr(
        "viser.infra._infra.websockets", type("Other", (), {"asyncio": type("A", (), {"server": vars_of(served)})})
    )
    with pytest.raises(RuntimeError, match="its version is not the one expected"):
        Studio(Workspace.at(tmp_path), port=0)
    assert served.serve is serve


def vars_of(module):
    return type("Server", (), {name: staticmethod(one) if callable(one) else one for name, one in vars(module).items()})


@pytest.fixture
def coming(studio, nobodies, monkeypatch):
    """Return what makes clients come to the studio, and what makes them go."""
    here = {}
    monkeypatch.setattr(studio._server, "get_clients", lambda: dict(here))

    def come(number):
        here[number] = nobodies(number)
        studio._come(here[number])
        return here[number]

    def go(number):
        studio._go(here.pop(number))

    yield come, go
    for number in list(here):
        go(number)


def told(client):
    """Return whether a browser was told that another one is at work here."""
    return client.shown() == [ELSEWHERE]


def test_one_window_at_a_time_and_the_next_goes_on_with_the_scene(studio, coming, settle):
    """The one before is told in one sentence, whether it goes then or not; nothing is lost."""
    come, go = coming
    first = come(1)
    window = studio.window
    window.post(lambda: window.change("camera", lambda d: edits.with_value(d, ("camera", "width"), 64)))
    settle(window)
    second = come(2)
    assert studio.window.client is second
    assert window.is_gone
    settle(studio.window)
    assert studio.window.scene.camera.width == 64
    assert told(first)
    go(1)
    assert studio.window.client is second, "as after a reload, which comes before it goes"
    assert not told(second)
    go(2)
    assert studio.window is None
    come(3)
    settle(studio.window)
    assert studio.window.history.past[-1][0] == "camera"


def test_a_browser_that_is_gone_before_its_panels_are_made_leaves_none(studio, nobody, monkeypatch):
    monkeypatch.setattr(studio._server, "get_clients", dict)
    gone = nobody(7)
    studio._go(gone)
    studio._come(gone)
    assert studio.window is None


def test_a_folder_that_cannot_be_read_is_told_and_the_browser_not_kept_waiting(
    tmp_path, nobody, run_studio, settle, monkeypatch
):
    """Reading takes long on a large folder: it is done in the window's thread, and what fails there is shown."""
    go_on = threading.Event()

    def read(*_):
        assert go_on.wait(60)
        raise OSError("the disk is gone")

    monkeypatch.setattr(Review, "__init__", read)
    running, client = run_studio(tmp_path, area="Session", session=(tmp_path, None)), nobody(8)
    monkeypatch.setattr(running._server, "get_clients", lambda: {8: client})
    running._come(client)
    go_on.set()
    settle(running.window)
    assert "the disk is gone" in client.told[0]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [(["--workspace", "nowhere"], "not a folder"), (["../scene.toml"], "outside of the workspace")],
)
def test_bad_arguments_are_told_in_one_message(tmp_path, run_rgbn, monkeypatch, arguments, told):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("studio.server.Studio", lambda *_, **how: pytest.fail("it began"))
    code, _, said = run_rgbn("studio", *arguments)
    assert (code, said.count("rgbn: "), "Traceback" in said) == (2, 1, False)
    assert told in said


def test_a_report_is_given_out_alone_and_without_rights(studio, tmp_path):
    """Of a folder that a window asked for, at an address that nobody guesses; no link leads out of the folder."""
    page = studio.page
    assert page.address_of(tmp_path) == "", "there is none yet"
    (tmp_path / "report.html").write_text("<h1>found</h1>")
    (tmp_path / "summary.json").write_text("{}")
    address = page.address_of(tmp_path)
    status, policy, body = asked(studio, address)
    assert (status, body) == (200, b"<h1>found</h1>")
    assert policy.startswith("sandbox ")
    assert "allow-same-origin" not in policy
    assert asked(studio, address, Origin="http://example.org")[0] == 403
    assert asked(studio, "/report/x/report.html")[0] == 404
    assert asked(studio, address.rpartition("/")[0] + "/../../summary.json")[2] != b"{}"
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.html").symlink_to(tmp_path / "summary.json")
    assert asked(studio, page.address_of(tmp_path / "out"))[0] == 404
