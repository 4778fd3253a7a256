"""Who may speak to the studio, and who not."""

import http.client
import subprocess
import sys
from pathlib import Path

import pytest

from lab.studio.server import Studio
from lab.studio.workspace import Workspace
from scene.errors import SceneError

pytestmark = [pytest.mark.render, pytest.mark.xdist_group("studio")]


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
