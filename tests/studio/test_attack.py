"""A studio that is attacked: it answers a proper window as before, and keeps neither memory nor a long log of it."""

import asyncio
import contextlib
import os
import re
import socket
import subprocess
import sys
import time
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from uuid import uuid4

import msgspec
import pytest
import viser
import zstandard
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from studio.editor import edits
from twin.description.description_file import write_document

pytestmark = [pytest.mark.full, pytest.mark.render]

MOST_BYTES = 600e6
"""Resident memory of the studio after the attack."""
MOST_LINES = 120
"""On the standard error in the whole attack of more than a minute: one a second at most."""
HALF_OPEN = 900
"""Sockets at a time; the studio may have 1024 files open."""
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1, 0, 0, 0], "position": [0, 0, 5], "fov": 0.8, "near": 0.1, "far": 100,
    "image_height": 480, "image_width": 640, "look_at": [0, 0, 0], "up_direction": [0, 1, 0],
}  # fmt: skip
GONE = (ConnectionClosed, InvalidHandshake, OSError, TimeoutError, EOFError, AttributeError)
"""What a client of whom the studio has enough is told; the last one by its own library, where it was still sending."""


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """`rgbn studio` as a person starts it: its address, its process, and what it says."""
    root = tmp_path_factory.mktemp("attacked")
    write_document(edits.start_document(), root / "bench")
    (root / "bench" / "scene.toml").rename(root / "bench" / "s.toml")
    with open(root / "said", "w") as said:
        process = subprocess.Popen(
            [sys.executable, "-c", "from rgbn.cli import main; main()"]
            + ["studio", "s.toml", "--workspace", str(root / "bench"), "--port", "0", "--no-browser"],
            stdout=said,
            stderr=said,
        )
    try:
        deadline = time.monotonic() + 120
        while not (found := re.search(r"http://127\.0\.0\.1:(\d+)", (root / "said").read_text())):
            assert process.poll() is None, (root / "said").read_text()
            assert time.monotonic() < deadline, "the studio does not begin"
            time.sleep(0.1)
        yield SimpleNamespace(
            port=int(found[1]), process=process, bench=root / "bench", said=lambda: (root / "said").read_text()
        )
    finally:
        process.kill()
        process.wait()


def memory(studio, kind="VmRSS"):
    """Return the studio's resident memory, or the most that it ever was (VmHWM), bytes."""
    lines = Path(f"/proc/{studio.process.pid}/status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(kind))


class Window:
    """A browser's window without a browser: it says what it is told to say, and knows the inputs that it was sent."""

    def __init__(self, socket):
        self.socket, self.inputs, self.seen = socket, {}, []

    async def say(self, message):
        await self.socket.send(message if isinstance(message, bytes | str) else msgspec.msgpack.encode(message))

    async def hear(self, seconds):
        """Take what the studio sends for so long."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while True:
                    self._take(await self.socket.recv())

    async def until(self, condition, seconds=120):
        async with asyncio.timeout(seconds):
            while not condition():
                self._take(await self.socket.recv())

    def _take(self, raw):
        size, packed = (int.from_bytes(raw[at : at + 8], "little") for at in (0, 8))
        plain = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + packed], max_output_size=size)
        for message in msgspec.msgpack.decode(plain)["messages"]:
            self.seen.append(message["type"])
            if "uuid" in message and "props" in message:
                self.inputs[message["uuid"]] = message

    def labelled(self, label):
        """Return the uuid of the input or button of these words."""
        return next(uuid for uuid, one in self.inputs.items() if one["props"].get("label") == label)

    async def press(self, label):
        await self.say({"type": "GuiUpdateMessage", "uuid": self.labelled(label), "updates": {"value": True}})


@contextlib.asynccontextmanager
async def window(studio, *, ready=True):
    """Open a window; `ready`: wait until it is furnished."""
    protocol = f"viser-v{viser.__version__}"
    async with connect(
        f"ws://127.0.0.1:{studio.port}", subprotocols=[protocol], max_size=None, proxy=None, open_timeout=30,
        close_timeout=1, compression=None,
    ) as opened:  # fmt: skip
        found = Window(opened)
        await found.say(CAMERA)
        if ready:
            # The studio opens where it was left last: the attack presses the buttons of other areas too.
            await found.until(lambda: any(one["props"].get("label") == "to Scene" for one in found.inputs.values()))
            await found.press("to Scene")
            await found.until(
                lambda: any((one["props"].get("label") or "").startswith("Add shape") for one in found.inputs.values())
            )
        yield found


def raw(studio, sent, *, seconds=15.0):
    """Return what the studio answers to bytes."""
    with socket.create_connection(("127.0.0.1", studio.port), seconds) as plug:
        plug.settimeout(seconds)
        answer = b""
        with contextlib.suppress(OSError):
            plug.sendall(sent)
            while part := plug.recv(65536):
                answer += part
    return answer


def request(studio, *lines, path="/"):
    return raw(studio, "\r\n".join([f"GET {path} HTTP/1.1", *lines, "", ""]).encode("latin-1"))


def status(answer):
    return int(answer.split()[1]) if answer.startswith(b"HTTP/") else 0


def attack_headers(studio):
    """Headers twice, none, foreign, too long, too many; paths and bytes that are none."""
    own = f"127.0.0.1:{studio.port}"
    host, upgrade = f"Host: {own}", ["Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"]
    key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="
    assert status(request(studio, host)) == 200
    refused = [
        [host, host], [], ["Host: example.org"], ["Host:"], [host, "Host: example.org"],
        [host, f"Origin: http://{own}", f"Origin: http://{own}"], [host, "Origin: http://example.org"],
        [host, "Origin: null"], [host, "Origin:"], [host, "Accept-Encoding: gzip", "Accept-Encoding: br"],
        [host, *upgrade, *upgrade, key], [host, *upgrade, key, key], [host, *upgrade, key],
        [host, *upgrade, key, "Sec-WebSocket-Protocol: viser-v0.0.1"], [host, *upgrade, "Sec-WebSocket-Key: x"],
        [host, "X: " + 9000 * "x"], [host, *(f"X-{k}: x" for k in range(200))],
        ["Host: [::1"], ["Host: 127.0.0.1:x:y"], [f"Host: evil@{own}"],
    ]  # fmt: skip
    for lines in refused:
        code = status(request(studio, *lines))
        assert code in (0, 400, 403, 404, 426, 431, 503), (code, lines)
    for path in ("/" + 5000 * "a", "/%00", "/../../etc/passwd", "/%2e%2e/x", "/a%5c..%5cb", "*", "http://x/", "/%ff"):
        assert status(request(studio, host, path=path)) in (0, 400, 404), path
    for noise in (b"POST / HTTP/1.1\r\n\r\n", b"\x16\x03\x01\x02\x00", b"\n" * 9000, b"GET /\r\n\r\n", b"\0" * 9000):
        assert status(raw(studio, noise)) in (0, 400)


def attack_half_open(studio):
    """Sockets that say nothing, half a request, or read nothing of the answer; the page comes all the same."""
    beginnings = [
        b"",
        b"GET / HTTP/1.1\r\nHost: x",
        f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{studio.port}\r\n\r\n".encode(),
    ]
    for _ in range(3):
        with contextlib.ExitStack() as held:
            plugs = []
            for number in range(HALF_OPEN):
                plug = held.enter_context(socket.socket())
                plug.settimeout(5)
                with contextlib.suppress(OSError):
                    plug.connect(("127.0.0.1", studio.port))
                    plug.sendall(beginnings[number % 3])
                plugs.append(plug)
            began = time.monotonic()
            assert status(request(studio, f"Host: 127.0.0.1:{studio.port}")) == 200
            assert time.monotonic() - began < 15, "a page must come while others hold their sockets open"


def frame(opcode, content, *, first=0x80):
    """Return a masked WebSocket frame; `first`: its upper bits."""
    size = len(content)
    head = bytes([first | opcode])
    head += bytes([0x80 | size]) if size < 126 else bytes([0x80 | 127]) + size.to_bytes(8, "big")
    return head + b"\0\0\0\0" + content


def attack_frames(studio):
    """Frames against the protocol: compressed bombs that nobody agreed on, fragments without end, wrong lengths."""
    hello = (
        f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{studio.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        f"Sec-WebSocket-Protocol: viser-v{viser.__version__}\r\n"
        "Sec-WebSocket-Extensions: permessage-deflate; client_max_window_bits\r\n\r\n"
    ).encode()
    bomb = zlib.compress(bytes(50_000_000), 9)[2:-4]
    for sent in (
        frame(2, bomb, first=0xC0),
        b"".join(frame(2 if not k else 0, bytes(65536), first=0) for k in range(900)),
        b"\x82\xff" + (2**62).to_bytes(8, "big") + bytes(1000),
        frame(2, bytes(45_000_000)),
        frame(1, b"\xff\xff"),
        frame(9, bytes(200)),
        frame(3, b""),
        b"\x82\x05hello",
    ):
        for _ in range(3):
            raw(studio, hello + sent, seconds=3)


def bad_messages():
    """Yield what is no message of viser's, or none that the studio waits for."""
    yield from (
        "text",
        "",
        b"",
        b"\xc1",
        b"\x81",
        b"\x91" * 100_000,
        b"\xdf\xff\xff\xff\xff",
        os.urandom(1000),
        17,
        None,
        [],
    )
    numbers = (float("nan"), float("inf"), 1e308, -(2**63), 2**64 - 1)
    yield from ({}, {"type": 3}, {"type": "Nothing"}, {"type": "Message"}, {"type": "GuiModalMessage"})
    for kind in ("GuiUpdateMessage", "ViewerCameraMessage", "FileTransferPart", "FileTransferStartUpload"):
        yield from ({"type": kind}, {"type": kind, "uuid": 3, "updates": "x"}, {"type": kind, "more": 1})
    yield {"type": "GuiUpdateMessage", "uuid": "unknown", "updates": {"value": 1}}
    yield {"type": "GuiUpdateMessage", "uuid": "x" * 900_000, "updates": {"value": "y" * 100_000}}
    for number in (*numbers, "x", None, [1], {}):
        yield CAMERA | {"position": [number, 0, 0]}
        yield CAMERA | {"fov": number, "image_width": number}
        for end in ("Update", "DragEnd"):
            yield {
                "type": f"TransformControls{end}Message", "name": "/object_0", "owner": "x", "wxyz": [number, 0, 0, 0],
                "position": [number, 0, 0],
            }  # fmt: skip
    yield CAMERA | {"wxyz": [1], "position": list(range(1000))}
    for number in range(300):
        yield {"type": "GuiFormDirtyMessage", "uuid": str(uuid4()) + "x" * 100_000}
        yield {"type": "FileTransferPart", "source_component_uuid": None, "transfer_uuid": str(number),
               "part_index": 0, "content": bytes(500_000)}  # fmt: skip
    yield {"type": "LocalStorageGetItemResponseMessage", "request_uuid": "x", "value": "y"}
    yield from ({"type": "GetRenderResponseMessage", "payload": bytes(900_000)}, {"type": "ShareUrlDisconnect"})


async def attack_messages(studio):
    """Each in a window of its own where it is enough to end one."""
    messages = list(bad_messages())
    while messages:
        with contextlib.suppress(*GONE):
            async with window(studio, ready=False) as opened:
                while messages:
                    message = messages.pop()
                    await opened.say(message)
                    if len(messages) % 50 == 0:
                        await opened.hear(0.05)
                await opened.hear(1)


async def attack_large(studio):
    """Messages of 45 MB, many at a time."""

    async def one():
        with contextlib.suppress(*GONE):
            async with window(studio, ready=False) as opened:
                for _ in range(4):
                    await opened.say({"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": bytes(45_000_000)}})

    await asyncio.gather(*(one() for _ in range(6)))


async def attack_inputs(studio):
    """Wrong types and numbers beyond sense in each input, and its inner properties instead of its value."""
    values = [
        float("nan"),
        float("inf"),
        1e308,
        -1e308,
        10**18,
        -1,
        "",
        "x" * 50_000,
        "\0../..",
        True,
        None,
        [],
        {},
        b"x",
    ]
    values += [[1] * 3, [1e308] * 3, ["x"] * 3, list(range(50_000)), [float("nan")] * 3, {"a": [{}]}, "9" * 6000]
    inner = [{"update_cb": [1]}, {"removed": True}, {"is_button": 1}, {"uuid": "x"}, {"props": None}, {"nothing": 1}]
    left: list = []
    async with window(studio) as opened:
        left = [key for key, one in opened.inputs.items() if "value" in one or "Button" in one["type"]]
        names = [opened.inputs[key]["props"].get("label") for key in left]
    assert len(left) > 20, names
    # Uuids are another window's own: each window goes on where the last one was sent away.
    at = 0
    while at < len(names):
        with contextlib.suppress(*GONE):
            async with window(studio) as opened:
                here = [key for key, one in opened.inputs.items() if "value" in one or "Button" in one["type"]]
                while at < len(names):
                    at += 1
                    for updates in [*({"value": value} for value in values), *inner]:
                        await opened.say({"type": "GuiUpdateMessage", "uuid": here[at % len(here)], "updates": updates})
                    await opened.hear(0.05)
                await opened.hear(2)


async def attack_uploads(studio):
    """Files without end, without parts, of wrong sizes, many at once, under names that lead out."""

    async def one(number):
        with contextlib.suppress(*GONE):
            async with window(studio) as opened:
                button = opened.labelled("Send a model from here")
                endless = {"type": "FileTransferStartUpload", "source_component_uuid": button, "mime_type": ""}
                for size, count in ((10**12, 10**9), (-1, -1), (0, 10**9), (10, 1), (50_000_000, 100), (2**70, 1)):
                    for _ in range(3):
                        key = str(uuid4())
                        name = {"filename": f"../../evil{number}.ply", "transfer_uuid": key}
                        with contextlib.suppress(OverflowError):
                            await opened.say(endless | name | {"size_bytes": size, "part_count": count})
                        part = {"type": "FileTransferPart", "source_component_uuid": button, "transfer_uuid": key}
                        for index in range(40):
                            await opened.say(part | {"part_index": index, "content": bytes(512 * 1024)})
                    await opened.hear(0.2)

    await asyncio.gather(*(one(number) for number in range(5)))


async def attack_connecting(studio):
    """Windows that come and go."""

    async def one():
        with contextlib.suppress(*GONE):
            async with window(studio, ready=False):
                pass

    for _ in range(15):
        await asyncio.gather(*(one() for _ in range(8)))


def run(work):
    """Run it in a thread of its own: Playwright, where another test has opened it, keeps a loop in this one."""
    with ThreadPoolExecutor(1) as pool:
        pool.submit(asyncio.run, work).result()


@pytest.mark.slow
def test_an_attack_leaves_the_studio_as_it_was(studio):
    async def proper():
        """Do what a person does: a window, a shape, a picture of it."""
        async with window(studio) as opened:
            before = len(opened.seen)
            await opened.press("Add shape")
            await opened.until(lambda: "MeshMessage" in opened.seen[before:])
            await opened.until(
                lambda: "GuiImageMessage" in opened.seen or opened.seen[before:].count("GuiUpdateMessage")
            )

    run(proper())
    told = [f"idle {memory(studio) / 1e6:.0f} MB"]
    for attack in (
        attack_headers, attack_half_open, attack_frames, attack_messages, attack_large, attack_inputs, attack_uploads,
        attack_connecting,
    ):  # fmt: skip
        began = time.monotonic()
        done = attack(studio)
        if done is not None:
            run(done)
        assert studio.process.poll() is None, f"{attack.__name__} ended the studio:\n{studio.said()}"
        told.append(f"{attack.__name__}: {time.monotonic() - began:.0f} s, then {memory(studio) / 1e6:.0f} MB")
    run(proper())
    told.append(f"in the end {memory(studio) / 1e6:.0f} MB, at most {memory(studio, 'VmHWM') / 1e6:.0f} MB")
    said = studio.said()
    print("\n".join([*told, f"{len(said.splitlines())} lines on the standard error"]))
    assert "Traceback" not in said, said[-4000:]
    assert len(said.splitlines()) < MOST_LINES, said[-4000:]
    assert memory(studio) < MOST_BYTES, told
    assert not [path for path in studio.bench.parent.rglob("*evil*") if studio.bench not in path.parents]
