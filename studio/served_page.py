"""What the studio's server gives out by itself: viser's page with the studio's own part, and reports of sessions."""

from http import HTTPStatus
from pathlib import Path
from secrets import token_urlsafe

from websockets.datastructures import Headers
from websockets.http11 import Response

HERE = Path(__file__).parent / "page"
REPORT = "report.html"
ALONE = "sandbox allow-scripts allow-popups allow-downloads allow-modals; frame-ancestors 'self'"
"""A report may have been made elsewhere: its scripts run without the rights of the studio's own page."""


class ServedPage:
    """The page, and the reports that windows have asked to be served, each at an address that cannot be guessed."""

    def __init__(self) -> None:
        import viser

        page = (Path(viser.__path__[0]) / "client" / "build" / "index.html").read_text("utf-8")
        style, script = ((HERE / f"studio.{kind}").read_text("utf-8") for kind in ("css", "js"))
        own = f"<style>{style}</style><script>{script}</script>"
        page = page.replace("<title>Viser</title>", "<title>rgbn studio</title>", 1)
        self._page = page.replace("</head>", f"{own}</head>", 1).encode()
        self._folders: dict[str, Path] = {}

    def address_of(self, folder: Path) -> str:
        """Return the address of an output folder's report as it is now; empty where there is none."""
        path = folder / REPORT
        if not path.is_file():
            return ""
        key = next((key for key, known in self._folders.items() if known == folder), None) or token_urlsafe(16)
        self._folders[key] = folder
        return f"/report/{key}/{path.stat().st_mtime_ns:x}"

    def answer(self, address: str) -> Response | None:
        """Return what lies at an address; None: nothing of the studio's own."""
        path = address.partition("?")[0]
        if path in ("/", "/index.html"):
            return _response(self._page)
        parts = path.split("/")
        if parts[:2] != ["", "report"]:
            return None
        folder = self._folders.get(parts[2]) if len(parts) > 2 else None
        if folder is None or (folder / REPORT).resolve().parent != folder.resolve():
            return Response(HTTPStatus.NOT_FOUND, "Not Found", Headers(), b"rgbn studio: there is no such report.\n")
        return _response((folder / REPORT).read_bytes(), ALONE)


def _response(body: bytes, policy: str = "frame-ancestors 'self'") -> Response:
    headers = Headers({
        "Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(body)), "Cache-Control": "no-store",
        "X-Content-Type-Options": "nosniff", "Content-Security-Policy": policy,
    })  # fmt: skip
    return Response(HTTPStatus.OK, "OK", headers, body)
