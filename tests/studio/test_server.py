"""Who may speak to the studio, and who not."""

import http.client
import socket
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest
from viser.infra import _infra

from scene.errors import SceneError
from studio import guarded_server
from studio.desk import Desk
from studio.editor import edits
from studio.editor.editor_window import EditorWindow, begun
from studio.editor.files_panel import FilesPanel
from studio.guarded_server import NAME
from studio.messages import Unfit
from studio.own_files import put_own
from studio.review.folder import Review
from studio.server import Studio
from studio.workspace import MOST_UPLOAD, Workspace
from twin.description.description_file import read_document, read_scene, write_document

pytestmark = [pytest.mark.render]


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    running = Studio(Workspace.at(tmp_path_factory.mktemp("bench")), port=0, desk=Desk(area="Scene"))
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


def test_a_header_that_comes_twice_is_refused(studio):
    host = studio.address.removeprefix("http://")
    for name in ("Host", "Origin", "Upgrade", "Accept-Encoding"):
        with socket.create_connection(("127.0.0.1", int(host.rpartition(":")[2])), 60) as plug:
            plug.sendall(f"GET / HTTP/1.1\r\nHost: {host}\r\n{name}: {host}\r\n{name}: {host}\r\n\r\n".encode())
            assert plug.recv(12) == b"HTTP/1.1 400", name


@pytest.mark.parametrize(
    "message",
    [
        {"type": "ShareUrlRequest"},
        {"type": "GuiFormDirtyMessage", "uuid": "x"},
        {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"update_cb": []}},
        {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": float("nan")}},
        {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": "x" * 20_000}},
        {"type": "TransformControlsUpdateMessage", "name": "x", "wxyz": [1, 0, 0, 0], "position": [0, 0, 1e300]},
        {"type": "TransformControlsUpdateMessage", "name": "x", "wxyz": [1, 0, 0], "position": [0, 0, 1]},
        ["x"],
    ],
)
def test_what_no_window_says_does_not_reach_viser(studio, message):
    """The relay with which viser publishes itself on the web is shut by that too."""
    with pytest.raises((Unfit, msgspec.ValidationError)):
        studio._guard.checked(None, msgspec.msgpack.encode(message))


@pytest.mark.parametrize(
    ("label", "good", "bad"),
    [
        ("a number", 2, ["2", None, True, [2]]),
        ("a text", "x", [2, None, b"x", ["x"]]),
        ("a choice", "b", ["c", 1, None]),
        ("three", [1, 2.5, 3], [[1, 2], [1, 2, "3"], 3, "abc"]),
        ("a tick", True, [1, "x", None]),
        ("hidden", None, [True]),
        ("a file", None, [True, "x", None, {"name": "x", "content": "y"}]),
    ],
)
def test_an_input_takes_only_values_of_its_kind(studio, nobody, monkeypatch, label, good, bad):
    client = nobody(9)
    gui = client.gui
    made = {
        "a number": lambda: gui.add_number(label, 1.0),
        "a text": lambda: gui.add_text(label, ""),
        "a choice": lambda: gui.add_dropdown(label, ("a", "b")),
        "three": lambda: gui.add_vector3(label, (0.0, 0.0, 1.0)),
        "a tick": lambda: gui.add_checkbox(label, False),
        "hidden": lambda: gui.add_checkbox(label, False, visible=False),
        "a file": lambda: gui.add_upload_button(label),
    }[label]()
    monkeypatch.setattr(studio._server, "get_clients", lambda: {9: client})

    def said(value):
        update = {"type": "GuiUpdateMessage", "uuid": made._impl.uuid, "updates": {"value": value}}
        return msgspec.msgpack.decode(studio._guard.checked(None, msgspec.msgpack.encode(update)))["updates"]["value"]

    if good is not None:
        assert said(good) == good
    for value in bad:
        with pytest.raises(Unfit):
            said(value)


def test_a_file_that_is_too_large_comes_without_content_and_its_parts_are_dropped(studio):
    sender = SimpleNamespace(uploads={})
    start = {
        "type": "FileTransferStartUpload", "source_component_uuid": "x", "transfer_uuid": "t", "filename": "big.ply",
        "mime_type": "", "part_count": 500, "size_bytes": MOST_UPLOAD + 1,
    }  # fmt: skip
    passed = msgspec.msgpack.decode(studio._guard.checked(sender, msgspec.msgpack.encode(start)))
    assert (passed["size_bytes"], passed["part_count"], passed["filename"]) == (0, 0, "big.ply")
    assert not sender.uploads
    passed = msgspec.msgpack.decode(
        studio._guard.checked(sender, msgspec.msgpack.encode(start | {"size_bytes": MOST_UPLOAD}))
    )
    assert (passed["size_bytes"], passed["part_count"]) == (MOST_UPLOAD, 500)
    assert sender.uploads == {"t": (MOST_UPLOAD, 500, 0)}


def test_viser_still_serves_by_the_name_that_is_exchanged(monkeypatch, tmp_path):
    """Where another version does not, the studio does not begin, rather than stand open."""
    assert NAME in vars(_infra)
    monkeypatch.setattr(guarded_server, "NAME", "another")
    monkeypatch.setattr(_infra, "another", _infra.websockets, raising=False)
    with pytest.raises(RuntimeError, match="its version is not the one expected"):
        Studio(Workspace.at(tmp_path), port=0)


def test_a_window_that_is_loaded_again_goes_on_with_its_scene(studio, nobody, monkeypatch):
    """Every closed window's scene, with its past, comes to a window that is opened; nothing is lost or shared."""
    here = {}
    monkeypatch.setattr(studio._server, "get_clients", lambda: here)

    def come(number):
        here[number] = nobody(number)
        studio._come(here[number])
        return studio._windows[number]

    def go(number):
        studio._go(here.pop(number))

    first, second, idle = come(1), come(2), come(3)
    for window, width in ((first, 64), (second, 80)):
        window.post(lambda window=window, width=width: window.change("camera", resized(width)))
    for window in (first, second, idle):
        done = threading.Event()
        window.post(done.set)
        assert done.wait(60)
    pasts = {window.scene.camera.width: window.history for window in (first, second)}
    for number in (1, 2, 3):
        go(number)
    found = [come(number) for number in (4, 5, 6)]
    assert {window.scene.camera.width for window in found} == {64, 80, 640}, "one begins anew"
    for window in found[:2]:
        assert window.history is pasts[window.scene.camera.width]
        assert "closed last" in window.client.told[0]
    for number in (4, 5, 6):
        go(number)
    studio._left.clear()


def resized(width):
    return lambda document: edits.with_value(document, ("camera", "width"), width)


def test_a_browser_that_is_gone_before_its_panels_are_made_leaves_none(studio, nobody, monkeypatch):
    monkeypatch.setattr(studio._server, "get_clients", dict)
    gone = nobody(7)
    studio._go(gone)
    studio._come(gone)
    assert not studio.windows


def test_a_folder_that_cannot_be_read_is_told_and_the_browser_not_kept_waiting(tmp_path, nobody, monkeypatch):
    """Reading takes long on a large folder: it is done in the window's thread, and what fails there is shown."""
    go_on = threading.Event()

    def read(*_):
        assert go_on.wait(60)
        raise OSError("the disk is gone")

    monkeypatch.setattr(Review, "read", read)
    running = Studio(Workspace.at(tmp_path), port=0, desk=Desk(area="Session", review=(tmp_path, None)))
    try:
        client = nobody(8)
        monkeypatch.setattr(running._server, "get_clients", lambda: {8: client})
        running._come(client)
        (window,) = running.windows
        go_on.set()
        done = threading.Event()
        window.post(done.set)
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
    code = "from rgbn.cli import main; main()"
    ran = subprocess.run(
        [sys.executable, "-c", code, "studio", *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert ran.returncode == 2
    assert told in ran.stderr
    assert "Traceback" not in ran.stderr


def test_a_report_is_given_out_alone_and_without_rights(studio, tmp_path):
    """Of a folder that a window asked for, at an address that nobody guesses; no link leads out of the folder."""
    own = studio.address.removeprefix("http://")

    def asked(path, **headers):
        connection = http.client.HTTPConnection(own, timeout=60)
        try:
            connection.request("GET", path, headers=headers)
            answer = connection.getresponse()
            return answer.status, answer.headers.get("Content-Security-Policy", ""), answer.read()
        finally:
            connection.close()

    page = studio._guard.page
    assert page.address_of(tmp_path) == "", "there is none yet"
    (tmp_path / "report.html").write_text("<h1>found</h1>")
    (tmp_path / "summary.json").write_text("{}")
    address = page.address_of(tmp_path)
    status_, policy, body = asked(address)
    assert (status_, body) == (200, b"<h1>found</h1>")
    assert policy.startswith("sandbox ")
    assert "allow-same-origin" not in policy
    assert asked(address, Origin="http://example.org")[0] == 403
    assert asked("/report/x/report.html")[0] == 404
    assert asked(address.rpartition("/")[0] + "/../../summary.json")[2] != b"{}"
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.html").symlink_to(tmp_path / "summary.json")
    assert asked(page.address_of(tmp_path / "out"))[0] == 404


def test_a_scene_that_another_window_saved_is_not_written_over_unseen(nobody, furnish, settle, tmp_path):
    place, windows = Workspace.at(tmp_path), []
    preview = SimpleNamespace(request=lambda *_: None, forget=lambda _: None)
    put_own(tmp_path / "a", lambda folder: write_document(edits.start_document(), folder))
    for number in (1, 2):
        history = begun(place, read_document(tmp_path / "a" / "scene.toml"), tmp_path / "a")
        windows.append(EditorWindow(nobody(number), place, preview, history))
        windows[-1].change("camera", resized(32 * number))
        furnish(windows[-1], [FilesPanel])
        windows[-1].client.says("Save scene")
        settle(windows[-1])
    assert read_scene(tmp_path / "a" / "scene.toml").camera.width == 64, "opened after the first had saved"
    windows[0].client.told.clear()
    windows[0].post(lambda: windows[0].panels[0]._save())
    settle(windows[0])
    assert "saved elsewhere" in windows[0].client.told[-1]
    assert read_scene(tmp_path / "a" / "scene.toml").camera.width == 64
