"""A page in the browser that shows a run while it goes on: an address on this machine that nobody can guess."""

import queue
import secrets
import threading
import time
from collections.abc import Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Self

from lapwing.cosim.config.run_config import RunConfig
from lapwing.studies.flight_data import FlightData
from lapwing.studies.flight_events import Event
from lapwing.studies.report.motion_3d import steps_to_json
from lapwing.studies.report.page import live_page

KEPT = 3000  # steps for a browser that comes late
WAITING = 300  # steps that a browser may be behind
FAREWELL = 1.0  # [s] that browsers get to hear of the end
STREAM, ICON = "steps", "/favicon.ico"  # browsers ask for the icon, which is empty
OVER = "event: over\ndata:\n\n"


class LivePage:
    """Serves the page; a context manager. The sockets are closed at its end."""

    def __init__(self, setup: RunConfig):
        """Of a run that is about to begin."""
        self._lock = threading.Lock()
        self._steps: list[str] = []
        self._browsers: list[queue.Queue[str]] = []
        self._over = False
        token = secrets.token_urlsafe(16)
        page = live_page(setup, STREAM).encode()
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), handler(f"/{token}/", page, self))
        self._server.daemon_threads = True
        self.address = f"http://127.0.0.1:{self._server.server_address[1]}/{token}/"
        threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True).start()

    def show(self, steps: Sequence[FlightData], events: Sequence[list[Event]]) -> None:
        """Show what is new of every vehicle, and what happened in it."""
        self._put(f"data: {steps_to_json(steps, events, first=not self._steps)}\n\n")

    def _put(self, text: str) -> None:
        with self._lock:
            self._steps.append(text)
            del self._steps[1 : max(1, len(self._steps) - KEPT)]  # the first has the shape
            for browser in self._browsers:
                if browser.full():  # misses the oldest
                    browser.get()
                browser.put(text)

    def steps(self) -> Any:
        """What there is for a browser, and what comes, to the end."""
        mine: queue.Queue[str] = queue.Queue(WAITING)
        with self._lock:
            known, over = list(self._steps), self._over
            self._browsers.append(mine)
        try:
            yield from known
            while not over:
                yield (text := mine.get())
                over = text is OVER
        finally:
            with self._lock:
                self._browsers.remove(mine)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._over = True
        self._put(OVER)
        self._server.shutdown()
        deadline = time.monotonic() + FAREWELL
        while self._browsers and time.monotonic() < deadline:
            time.sleep(0.01)
        self._server.server_close()


def handler(root: str, page: bytes, live: LivePage) -> type[BaseHTTPRequestHandler]:
    """Who answers a browser: the page at `root`, its steps below."""

    class Handler(BaseHTTPRequestHandler):
        """Gives the page, and the steps of the flight as server-sent events; nothing at any other address."""

        def do_GET(self) -> None:
            kinds = {root: "text/html; charset=utf-8", root + STREAM: "text/event-stream", ICON: "image/x-icon"}
            asked = self.path.encode()
            kind = next((kinds[path] for path in kinds if secrets.compare_digest(path.encode(), asked)), None)
            if kind is None:
                self.send_error(404)
                return
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Cache-Control", "no-store")
            self.send_header("Referrer-Policy", "no-referrer")
            self.end_headers()
            try:
                if self.path == root:
                    self.wfile.write(page)
                elif self.path != ICON:
                    for text in live.steps():
                        self.wfile.write(text.encode())
            except OSError:  # the browser is gone
                return

        def log_message(self, *_: Any) -> None:
            """Say nothing."""

    return Handler
