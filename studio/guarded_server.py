"""Who and what may come in: what stands between the network and viser, which believes what it is told.

A browser sends the page that a script came from as `Origin`; others than this server's are turned away, so that no page
on the web can speak to a studio on the loopback address. What a window says is read strictly, as viser's own types have
it, and goes on as what was read. What does not fit is dropped with one line, one a second at most.

All limits are public parameters of `websockets`. viser 1.1 has no way to be given them: it calls `serve` inside of its
own function, with arguments of its own. `_serving` puts another `serve` before viser alone, while its server is made;
a proxy would read and write each message once more. `_input_of` is the one place that looks into viser's tables.
`tests/studio` tell when either changes.
"""

import contextlib
import dataclasses
import logging
import time
from collections.abc import Callable, Iterator
from functools import partial
from http import HTTPStatus
from types import SimpleNamespace
from typing import Any

import msgspec
from websockets.asyncio.server import ServerConnection, serve

from lab.progress import say
from studio.messages import HEARD, Kind, Unfit, check_value, fits
from studio.served_page import ServedPage
from studio.workspace import MOST_UPLOAD

LOOPBACK = ("127.0.0.1", "localhost", "::1")
MOST_MESSAGE = 2**20
"""Bytes of a message. The page sends files in parts of half of that."""
MOST_WINDOWS = 16
MOST_CONNECTIONS = 128
MOST_FAULTS = 1000
"""Of one window, before it is closed."""
NAME = "websockets"
"""Of the library, in viser's module."""
LOG = logging.getLogger("rgbn.studio")


class _Rationed(logging.Handler):
    """Says a record in one line, one a second at most."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._next, self._missed = 0.0, 0

    def emit(self, record: logging.LogRecord) -> None:
        now = time.monotonic()
        if now < self._next:
            self._missed += 1
            return
        fault = record.exc_info[1] if record.exc_info else None
        text = record.getMessage() if fault is None else f"{record.getMessage()} ({type(fault).__name__}: {fault})"
        more = f" And {self._missed} more since the last such line." if self._missed else ""
        say(f"studio: {text.splitlines()[0][:200]}{more}")
        self._next, self._missed = now + 1.0, 0


LOG.propagate = False
LOG.addHandler(_Rationed())


class GuardedServer:
    """Makes viser's server, `server`, on a port (0: one that is free), and stands before it."""

    def __init__(self, host: str, port: int, **options: Any) -> None:
        import viser
        from viser import _messages

        self._host, self._protocol = host, f"viser-v{viser.__version__}"
        self.page = ServedPage()
        self._answer: Callable[..., Any] | None = None
        self._heard = {name: msgspec.msgpack.Decoder(getattr(_messages, name)) for name in HEARD}
        self.connections: dict[Connection, None] = {}
        """All that are open, in the order in which they came."""
        with _serving(self._serve):
            self.server = viser.ViserServer(host=host, port=port, **options)
        if self._answer is None:
            self.server.stop()
            raise RuntimeError("viser did not serve through the studio's door; its version is not the one expected.")
        loop = self.server.get_event_loop()

        def say_fault(_: Any, context: dict[str, Any]) -> None:
            LOG.warning("%s", context["message"], exc_info=context.get("exception"))

        loop.call_soon_threadsafe(loop.set_exception_handler, say_fault)

    def _serve(self, handler: Any, host: str, port: int, **options: Any) -> Any:
        self._answer = options["process_request"]
        own: dict[str, Any] = {"process_request": self._admit, "max_size": MOST_MESSAGE, "logger": LOG}
        own["create_connection"] = partial(Connection, self)
        return serve(handler, host, port, **(options | own))

    def _admit(self, connection: "Connection", request: Any) -> Any:
        """Answer a request, or turn it away; None: it is a window's socket, and comes in."""
        assert self._answer is not None
        headers = request.headers
        if len({name.lower() for name in headers}) != len(list(headers.raw_items())):
            return connection.respond(HTTPStatus.BAD_REQUEST, "rgbn studio: a header was sent twice.\n")
        named, origin = headers.get("Host", ""), headers.get("Origin")
        is_ours = origin is None or origin.partition("//")[2] == named
        if not is_ours or (self._host in LOOPBACK and named.rpartition(":")[0].strip("[]") not in LOOPBACK):
            return connection.respond(HTTPStatus.FORBIDDEN, "rgbn studio: this page may not speak to it.\n")
        connection.is_window = "Upgrade" in headers
        if connection.is_window and headers.get("Sec-WebSocket-Protocol") != self._protocol:
            return connection.respond(HTTPStatus.BAD_REQUEST, "rgbn studio: load its page again.\n")
        if sum(one.is_window for one in self.connections) > MOST_WINDOWS - (not connection.is_window):
            connection.is_window = False
            text = f"rgbn studio: {MOST_WINDOWS} windows are open, the most at a time. Close one, and load this page.\n"
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, text)
        try:
            own = None if connection.is_window else self.page.answer(request.path)
            return own or self._answer(connection, request)
        except (OSError, ValueError):
            return connection.respond(HTTPStatus.NOT_FOUND, "rgbn studio: there is no such page.\n")

    def checked(self, sender: "Connection", sent: bytes | str) -> bytes | None:
        """Return a message as viser may have it; None: a part of a file that was not let in.

        Raises Unfit, msgspec.MsgspecError: it is none, or does not fit.
        """
        if isinstance(sent, str):
            raise Unfit("text instead of a message")
        kind = msgspec.msgpack.decode(sent, type=Kind).type
        if kind not in self._heard:
            raise Unfit(f"{kind[:40]!r} is nothing that a window says")
        message = self._heard[kind].decode(sent)
        if kind == "FileTransferStartUpload":
            message = self._begun(sender, message)
        elif kind == "FileTransferPart":
            if not sender.takes_part(message):
                return None
        elif not fits(vars(message)):
            raise Unfit(f"{kind}: a number or a text that is too large")
        if kind == "GuiUpdateMessage":
            if message.updates.keys() != {"value"}:
                raise Unfit("an input has nothing to change but its value")
            check_value(self._input_of(message.uuid), message.updates["value"])
        return msgspec.msgpack.encode({"type": kind, **vars(message)})

    def _begun(self, sender: "Connection", message: Any) -> Any:
        """Return the begin of an upload: one without content where it is larger than may be."""
        announced = (size for one in self.connections for size, *_ in one.uploads.values())
        left = MOST_UPLOAD - sum(announced)
        if 0 <= message.size_bytes <= left and 0 <= message.part_count <= 1 + message.size_bytes // 1024:
            sender.uploads[message.transfer_uuid] = message.size_bytes, message.part_count, 0
            return message
        return dataclasses.replace(message, size_bytes=0, part_count=0)

    def _input_of(self, uuid: str) -> Any:
        """Return the input of an identifier, None where there is none."""
        inputs = (one.gui._gui_input_handle_from_uuid.get(uuid) for one in self.server.get_clients().values())
        return next((one for one in inputs if one is not None), None)


class Connection(ServerConnection):
    """A connection to a `GuardedServer`."""

    def __init__(self, guard: GuardedServer, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._guard, self._faults, self.is_window = guard, 0, False
        self.uploads: dict[str, tuple[int, int, int]] = {}
        """Files that were let in: bytes that are still to come, parts in all, number of the next one."""

    def takes_part(self, part: Any) -> bool:
        """Count a part of a file; return whether the file was let in.

        Raises Unfit: it is not the next one, or more or less than was announced. The window is closed, which clears the
        rest.
        """
        if part.transfer_uuid not in self.uploads:
            return False  # The page sends all parts of a file, whatever it is told.
        size, count, number = self.uploads.pop(part.transfer_uuid)
        size -= len(part.content)
        is_last = number == count - 1
        if part.part_index != number or size < 0 or (is_last and size):
            self._faults = MOST_FAULTS
            raise Unfit("a file that is not what was announced")
        if not is_last:
            self.uploads[part.transfer_uuid] = size, count, number + 1
        return True

    def connection_made(self, transport: Any) -> None:
        """Begin. Where there are too many, the one that has waited longest to ask goes."""
        super().connection_made(transport)
        others = self._guard.connections
        if len(others) >= MOST_CONNECTIONS:
            waiting = next(one for one in others if not one.is_window)
            del others[waiting]
            waiting.transport.abort()
        others[self] = None

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self._guard.connections.pop(self, None)
        super().connection_lost(exc)

    async def recv(self, decode: bool | None = None) -> Any:
        """Return the next message that fits."""
        while True:
            sent = await super().recv(decode)
            try:
                message = self._guard.checked(self, sent)
                if message is not None:
                    return message
            except (Unfit, msgspec.MsgspecError, RecursionError, ValueError) as fault:
                self._faults += 1
                LOG.warning("what a window said was dropped: %s", fault)
                if self._faults >= MOST_FAULTS:
                    await self.close(1008, "rgbn studio: too much of what this window says cannot be understood.")


@contextlib.contextmanager
def _serving(serve: Callable[..., Any]) -> Iterator[None]:
    """Have viser call `serve` where it says `websockets.asyncio.server.serve`. The library itself stays as it is."""
    from viser.infra import _infra

    own = getattr(_infra, NAME)
    server = SimpleNamespace(**vars(own.asyncio.server) | {"serve": serve})
    setattr(_infra, NAME, SimpleNamespace(**vars(own) | {"asyncio": SimpleNamespace(server=server)}))
    try:
        yield
    finally:
        setattr(_infra, NAME, own)
