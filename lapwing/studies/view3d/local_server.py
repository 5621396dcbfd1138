"""viser's server on this machine only: behind a secret path, for pages of its own address."""

import contextlib
import http
import logging
import threading
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any
from unittest import mock

from lapwing.studies.local_pages import ADDRESS, hosts, refusal

_LOCK = threading.Lock()  # one server starts at a time: the guard is put in while it starts


@contextlib.contextmanager
def run_server(token: str = "", changed: Callable[[str], str] | None = None) -> Iterator[Any]:
    """Run a viser server until the end of the context.

    viser binds a port but has no secret and accepts every origin, so requests pass a guard before they reach it.

    Args:
        token: first part of the path of every request that is answered; "" answers none.
        changed: turns the client's page into the one that is served.
    """
    with _LOCK:
        _mute_viser()
        import viser
        import websockets.asyncio.server as sockets

        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)  # it logs each rejected request
        guard = Guard(token, changed)
        original = sockets.serve

        def add_guard(*arguments: Any, **options: Any) -> Any:
            guard.answer = options["process_request"]
            return original(*arguments, **{**options, "process_request": guard})

        with mock.patch.object(sockets, "serve", add_guard), mock.patch("rich.print", _silent):
            server = viser.ViserServer(host=ADDRESS, port=0, verbose=False)
        guard.hosts = hosts(server.get_port())
    try:
        yield server
    finally:
        server.stop()


def _silent(*_: Any) -> None:
    """Print nothing."""


@cache
def _mute_viser() -> None:
    """Drop viser's message that it has stopped: on a busy machine its thread prints it after `stop` has returned."""
    import rich

    original = rich.print

    def other_messages(*objects: Any, **options: Any) -> None:
        if not str(objects[0] if objects else "").startswith("[bold](viser)"):
            original(*objects, **options)

    mock.patch("rich.print", other_messages).start()


class Guard:
    """Answers requests in the place of viser's own function: only with the secret, the host and the origin."""

    def __init__(self, token: str, changed: Callable[[str], str] | None):
        self._token, self._changed = token, changed
        self.hosts: set[str] = set()
        self.answer: Any = None

    def refused(self, path: str, headers: Any) -> http.HTTPStatus | None:
        """Return the status of a rejection, or None if the request may pass."""
        return refusal(path, headers.get("Host"), headers.get_all("Origin") or [], self._token, self.hosts)

    def __call__(self, connection: Any, request: Any) -> Any:
        """Answer a request; None lets a websocket connect."""
        if (status := self.refused(request.path, request.headers)) is not None:
            return connection.respond(status, status.phrase + "\n")
        request.path = "/" + request.path.lstrip("/").partition("/")[2]
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return None
        if "Accept-Encoding" in request.headers:
            del request.headers["Accept-Encoding"]  # the page is changed as text
        response = self.answer(connection, request)
        if (
            self._changed is not None
            and response is not None
            and request.path.partition("?")[0] in ("/", "/index.html")
        ):
            response.body = self._changed(response.body.decode()).encode()
            del response.headers["Content-Length"]  # an assignment would add a second one
            response.headers["Content-Length"] = str(len(response.body))
        if response is not None:
            response.headers["Cache-Control"] = "no-store"
            response.headers["Referrer-Policy"] = "no-referrer"
        return response
