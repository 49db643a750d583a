"""`trocar resect --browser`: the same session by sliders and buttons, and looked at.

All that changes the session is a line of the console, also where a slider was moved or
a button pressed: what is planned by clicks is planned by lines. Meshcat draws; a page
of our own has the controls, the answer in words, and three slices of the patient.

The page is served under a path that nobody can guess, so that no other page that is
open in the browser can plan.
"""

from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
import json
from pathlib import Path
import secrets
from threading import Thread
from typing import Any
from urllib.parse import parse_qs, urlsplit

from diagrams.common.replay import start_meshcat
from diagrams.resection.desk import Desk
from diagrams.resection.scenario import ResectionScenario

PAGE = Path(__file__).with_name("page.html")

MOST_SENT = 10_000
"""By a page at once, in bytes."""


def serve(desk: Desk, host: str) -> tuple[ThreadingHTTPServer, str]:
    """Serves a desk's page in threads of its own.

    Args:
        desk: What is shown.
        host: Where to listen: on this machine alone; "*" for all that reach it.

    Returns:
        The server, to be shut down, and the page's address.
    """
    secret = secrets.token_urlsafe(16)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            url = urlsplit(self.path)
            path = url.path.removeprefix(f"/{secret}/")
            if path == url.path:
                self.send_error(HTTPStatus.NOT_FOUND)
            elif path == "":
                self._answer(PAGE.read_bytes(), "text/html; charset=utf-8")
            elif path == "state":
                with suppress(ValueError):
                    after = int(parse_qs(url.query).get("after", ["-1"])[0])
                    self._answer(json.dumps(desk.state(after)).encode())
            elif path in desk.pictures:
                self._answer(desk.pictures[path], "image/png")
            else:
                self.send_error(HTTPStatus.NOT_FOUND)

        def do_POST(self) -> None:
            what = self.path.removeprefix(f"/{secret}/")
            if what == self.path:
                self.send_error(HTTPStatus.NOT_FOUND)
                return
            try:
                length = int(self.headers.get("Content-Length", ""))
                if not 0 <= length <= MOST_SENT:
                    raise ValueError(f"{length} bytes")
                desk.want(what, json.loads(self.rfile.read(length)))
                self._answer(b"{}")
            except (ValueError, KeyError, TypeError) as error:
                self.send_error(HTTPStatus.BAD_REQUEST, str(error)[:200])

        def _answer(self, body: bytes, kind: str = "application/json") -> None:
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Cache-Control", "no-store")
            self.send_header("Referrer-Policy", "no-referrer")
            self.end_headers()
            with suppress(BrokenPipeError, ConnectionResetError):
                self.wfile.write(body)

        def log_message(self, *args: Any) -> None:
            """Says nothing."""

    server = ThreadingHTTPServer(("" if host == "*" else host, 0), Handler)
    server.daemon_threads = True
    Thread(target=server.serve_forever, daemon=True).start()
    shown = "localhost" if host == "*" else host
    return server, f"http://{shown}:{server.server_port}/{secret}/"


def run_browser(
    scenario: ResectionScenario,
    file: Path,
    host: str = "localhost",
    opened: Callable[[str], Any] = print,
) -> Desk:
    """Plans in the browser until the page says so or Ctrl-C.

    Args:
        scenario: Of the resection.
        file: The session's.
        host: Where to listen.
        opened: Called with the page's address.

    Returns:
        The desk as it was left; its session is saved.
    """
    desk = Desk(scenario, file, start_meshcat(host))
    server, address = serve(desk, host)
    try:
        opened(address)
        with suppress(KeyboardInterrupt):
            while not desk.is_over:
                desk.turn()
    finally:
        desk.close()
        server.shutdown()
        server.server_close()
    return desk
