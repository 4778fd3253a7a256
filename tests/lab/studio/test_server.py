"""Who may speak to the studio, and who not."""

import http.client
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from lab.studio import edits
from lab.studio.review.folder import Review
from lab.studio.server import Studio
from lab.studio.workspace import Workspace
from scene.errors import SceneError

pytestmark = [pytest.mark.render]


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    running = Studio(Workspace.at(tmp_path_factory.mktemp("bench")), port=0)
    yield running
    running.close()


def status(studio, headers):
    connection = http.client.HTTPConnection(studio.address.removeprefix("http://"), timeout=60)
    try:
        connection.request("GET", "/", headers=headers)
        return connection.getresponse().status
    finally:
        connection.close()


def test_only_its_own_page_may_speak_to_it(studio):
    """A page on the web that names the loopback address, or a name that was made to lead there, is turned away."""
    own = studio.address.removeprefix("http://")
    port = own.rpartition(":")[2]
    assert status(studio, {}) == 200
    assert status(studio, {"Origin": f"http://{own}"}) == 200
    assert status(studio, {"Host": f"localhost:{port}", "Origin": f"http://localhost:{port}"}) == 200
    assert status(studio, {"Origin": "http://example.org"}) == 403
    assert status(studio, {"Origin": f"http://127.0.0.1:{int(port) + 1}"}) == 403
    assert status(studio, {"Origin": "null"}) == 403
    assert status(studio, {"Host": f"example.org:{port}", "Origin": f"http://example.org:{port}"}) == 403


def test_a_strangers_socket_is_turned_away(studio):
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    address = studio.address.replace("http", "ws")
    with pytest.raises(InvalidStatus, match="403"):
        connect(address, origin="http://example.org", proxy=None)


def test_it_listens_on_the_loopback_address_alone(studio):
    assert studio.address.startswith("http://127.0.0.1:")
    port = int(studio.address.rpartition(":")[2])
    sockets = Path("/proc/net/tcp").read_text().splitlines()
    listening = [line.split() for line in sockets if f":{port:04X} 00000000:0000 0A" in line]
    assert [row[1] for row in listening] == [f"0100007F:{port:04X}"]


def test_a_taken_port_is_told(studio, tmp_path):
    port = int(studio.address.rpartition(":")[2])
    with pytest.raises(SceneError, match=f"--port {port}: cannot be used"):
        Studio(Workspace.at(tmp_path), port=port)


def test_the_web_relay_is_shut(studio):
    """A server of viser's publishes itself on the web when a browser asks for it; this one does nothing."""
    from viser import _messages

    server = studio._server
    handlers = server._websock_server._incoming_handlers[_messages.ShareUrlRequest]
    assert handlers
    for handle in handlers:
        handle(0, _messages.ShareUrlRequest())
    server._thread_executor.submit(int).result()
    assert server._share_tunnel is None


def test_a_window_that_is_loaded_again_goes_on_with_its_scene(studio, nobody, monkeypatch):
    """Every closed window's scene, with its past, comes to a window that is opened; nothing is lost or shared."""
    here = {}
    monkeypatch.setattr(studio._server, "get_clients", lambda: here)

    def come(number):
        here[number] = nobody(number)
        studio._come(here[number])
        return studio._desks[number]

    def go(number):
        studio._go(here.pop(number))

    first, second, idle = come(1), come(2), come(3)
    for desk, width in ((first, 64), (second, 80)):
        desk.post(lambda desk=desk, width=width: desk.change("camera", resized(width)))
    for desk in (first, second, idle):
        done = threading.Event()
        desk.post(done.set)
        assert done.wait(60)
    pasts = {desk.scene.camera.width: desk.history for desk in (first, second)}
    for number in (1, 2, 3):
        go(number)
    found = [come(number) for number in (4, 5, 6)]
    assert {desk.scene.camera.width for desk in found} == {64, 80, 640}, "one begins anew"
    for desk in found[:2]:
        assert desk.history is pasts[desk.scene.camera.width]
        assert "closed last" in desk.client.told[0]
    for number in (4, 5, 6):
        go(number)
    studio._left.clear()


def resized(width):
    return lambda scene: edits.with_camera(scene, width=width, height=60, focal_px=200.0, orthographic=False)


def test_a_browser_that_is_gone_before_its_desk_is_made_leaves_none(studio, nobody, monkeypatch):
    monkeypatch.setattr(studio._server, "get_clients", dict)
    gone = nobody(7)
    studio._go(gone)
    studio._come(gone)
    assert not studio.desks


def test_a_folder_that_cannot_be_read_is_told_and_the_browser_not_kept_waiting(tmp_path, nobody, monkeypatch):
    """Reading takes long on a large folder: it is done in the desk's thread, and what fails there is shown."""
    go_on = threading.Event()

    def read(*_):
        assert go_on.wait(60)
        raise OSError("the disk is gone")

    monkeypatch.setattr(Review, "read", read)
    running = Studio(Workspace.at(tmp_path), port=0, review=(tmp_path, None))
    try:
        client = nobody(8)
        monkeypatch.setattr(running._server, "get_clients", lambda: {8: client})
        running._come(client)
        (desk,) = running.desks
        go_on.set()
        done = threading.Event()
        desk.post(done.set)
        assert done.wait(60)
        assert "the disk is gone" in client.told[0]
    finally:
        go_on.set()
        running.close()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [(["--workspace", "nowhere"], "not a folder"), (["../scene.toml"], "outside of the workspace")],
)
def test_bad_arguments_are_told_in_one_message(tmp_path, arguments, told):
    code = "from lab.cli import main; main()"
    ran = subprocess.run(
        [sys.executable, "-c", code, "studio", *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert ran.returncode == 2
    assert told in ran.stderr
    assert "Traceback" not in ran.stderr
