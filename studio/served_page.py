"""What the studio's server answers before viser does: who may ask, its own page, and reports of sessions.

A browser sends the page that a script came from as `Origin`, and the name that it was led by as `Host`: others than
this server's own are turned away, so that no page on the web can speak to a studio on the loopback address. viser calls
`websockets.asyncio.server.serve` inside of a function of its own, and has no way to be given an answer: another
`serve` takes its place while the server is made.
"""

from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from pathlib import Path
from secrets import token_urlsafe
from typing import Any

from websockets.asyncio import server as served
from websockets.datastructures import Headers
from websockets.http11 import Response

LOOPBACK = "127.0.0.1"
PAGE = Path(__file__).parent / "page"
REPORT = "report.html"
ALONE = "sandbox allow-scripts allow-popups allow-downloads allow-modals; frame-ancestors 'self'"
"""A report may have been made elsewhere: its scripts run without the rights of the studio's own page."""


class ServedPage:
    """The page, and the reports that were asked to be served, each at an address that cannot be guessed."""

    def __init__(self) -> None:
        import viser

        page = (Path(viser.__path__[0]) / "client" / "build" / "index.html").read_text("utf-8")
        style, script = ((PAGE / f"studio.{kind}").read_text("utf-8") for kind in ("css", "js"))
        page = page.replace("<title>Viser</title>", "<title>rgbn studio</title>", 1)
        self._page = page.replace("</head>", f"<style>{style}</style><script>{script}</script></head>", 1).encode()
        self._folders: dict[str, Path] = {}

    def make_server(self, port: int) -> Any:
        """Return viser's server on the loopback address, before which this page answers."""
        import viser

        serve, is_used = served.serve, []

        def begin(handler: Any, host: str, port: int, process_request: Callable[..., Any], **options: Any) -> Any:
            is_used.append(True)
            return serve(handler, host, port, process_request=partial(self._admit, process_request), **options)

        served.serve = begin  # type: ignore[assignment]
        try:
            server = viser.ViserServer(host=LOOPBACK, port=port, label="rgbn studio", verbose=False)
        finally:
            served.serve = serve
        if not is_used:
            server.stop()
            raise RuntimeError("viser did not serve through the studio's door; its version is not the one expected.")
        return server

    def address_of(self, folder: Path) -> str:
        """Return the address of an output folder's report as it is now; empty where there is none."""
        path = folder / REPORT
        if not path.is_file():
            return ""
        key = next((key for key, known in self._folders.items() if known == folder), None) or token_urlsafe(16)
        self._folders[key] = folder
        return f"/report/{key}/{path.stat().st_mtime_ns:x}"

    def _admit(self, answer: Callable[..., Any], connection: Any, request: Any) -> Any:
        """Answer a request, or turn it away; None: it is a browser's socket, and comes in."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        # The port is another one where it comes through a tunnel.
        is_here = len(hosts) == 1 and hosts[0].partition(":")[0] in (LOOPBACK, "localhost")
        if not is_here or (origins and origins != [f"http://{hosts[0]}"]):
            return connection.respond(HTTPStatus.FORBIDDEN, "rgbn studio: this page may not speak to it.\n")
        is_socket = "Upgrade" in request.headers
        try:
            return (None if is_socket else self._answer(request.path)) or answer(connection, request)
        except (OSError, ValueError):
            return connection.respond(HTTPStatus.NOT_FOUND, "rgbn studio: there is no such page.\n")

    def _answer(self, address: str) -> Response | None:
        """Return what lies at an address; None: nothing of the studio's own."""
        path = address.partition("?")[0]
        if path in ("/", "/index.html"):
            return _response(self._page, "frame-ancestors 'self'")
        parts = path.split("/")
        if parts[:2] != ["", "report"]:
            return None
        folder = self._folders.get(parts[2]) if len(parts) > 2 else None
        if folder is None or (folder / REPORT).resolve().parent != folder.resolve():
            raise ValueError
        return _response((folder / REPORT).read_bytes(), ALONE)


def _response(body: bytes, policy: str) -> Response:
    headers = Headers({
        "Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(body)), "Cache-Control": "no-store",
        "X-Content-Type-Options": "nosniff", "Content-Security-Policy": policy,
    })  # fmt: skip
    return Response(HTTPStatus.OK, "OK", headers, body)
