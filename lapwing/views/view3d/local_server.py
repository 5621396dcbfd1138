"""viser's server, restricted to this machine, a secret path and its own origin."""

import contextlib
import http
import logging
import threading
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any
from unittest import mock

from lapwing.views.local_pages import ADDRESS, hosts, rejection

_LOCK = threading.Lock()  # one server starts at a time: the guard is installed by a patch during the start


@contextlib.contextmanager
def run_server(
    token: str = "",
    transform: Callable[[str], str] | None = None,
    take_sticks: Callable[[str], bool] = lambda query: False,
) -> Iterator[Any]:
    """Run a viser server until the end of the context.

    viser has no authentication and accepts every origin, so a guard filters the requests.

    Args:
        token: required first part of the path of a request; "" rejects all requests.
        transform: returns the page to serve from that of viser's client.
        take_sticks: takes the query of a request for `sticks`; returns False if it is invalid.
    """
    with _LOCK:
        _mute_viser()
        import viser
        import websockets.asyncio.server as sockets

        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)  # it logs each rejected request
        guard = Guard(token, transform, take_sticks)
        original = sockets.serve

        def add_guard(*arguments: Any, **options: Any) -> Any:
            guard.handler = options["process_request"]
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
    """Suppress viser's messages, such as the one that its thread may print after `stop` has returned."""
    import rich

    original = rich.print

    def other_messages(*objects: Any, **options: Any) -> None:
        if not str(objects[0] if objects else "").startswith("[bold](viser)"):
            original(*objects, **options)

    mock.patch("rich.print", other_messages).start()


class Guard:
    """Filter of requests before viser's handler: it requires the secret, the host and the origin."""

    def __init__(self, token: str, transform: Callable[[str], str] | None, take_sticks: Callable[[str], bool]):
        self._token, self._transform, self._take_sticks = token, transform, take_sticks
        self.hosts: set[str] = set()
        self.handler: Any = None

    def rejection(self, path: str, headers: Any) -> http.HTTPStatus | None:
        """Return the status of a rejection, or None if the request is accepted."""
        return rejection(path, headers.get("Host"), headers.get_all("Origin") or [], self._token, self.hosts)

    def __call__(self, connection: Any, request: Any) -> Any:
        """Return the response to a request, or None to accept a websocket."""
        if (status := self.rejection(request.path, request.headers)) is not None:
            return connection.respond(status, status.phrase + "\n")
        request.path = "/" + request.path.lstrip("/").partition("/")[2]
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return None
        name, _, query = request.path.partition("?")
        if name == "/sticks":
            accepted = self._take_sticks(query)
            return connection.respond(http.HTTPStatus.OK if accepted else http.HTTPStatus.BAD_REQUEST, "")
        if "Accept-Encoding" in request.headers:
            del request.headers["Accept-Encoding"]  # the page is transformed as text
        response = self.handler(connection, request)
        if (
            self._transform is not None
            and response is not None
            and request.path.partition("?")[0] in ("/", "/index.html")
        ):
            response.body = self._transform(response.body.decode()).encode()
            del response.headers["Content-Length"]  # an assignment would add a second one
            response.headers["Content-Length"] = str(len(response.body))
        if response is not None:
            response.headers["Cache-Control"] = "no-store"
            response.headers["Referrer-Policy"] = "no-referrer"
        return response
