"""Server of the studio at a secret address on this machine."""

import asyncio
import http
import secrets
import socket
import threading
import webbrowser
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from lapwing.views.local_pages import ADDRESS, hosts, rejection
from lapwing.views.studio import require
from lapwing.views.studio.recent_flights import RecentFlights
from lapwing.views.studio.run_processes import StudioRuns


def serve(port: int, report: Callable[[str], None]) -> None:
    """Serve the page until SIGINT or SIGTERM, which also end the current run.

    Args:
        port: TCP port; 0: any free one.
        report: called with the line with the address.

    Raises:
        ValueError: the extra `studio` is missing, or the port is in use.
    """
    require()
    import uvicorn

    from lapwing.views.studio.pages import Pages
    from lapwing.views.studio.scene_forms import schema

    token = secrets.token_urlsafe(16)
    with _listening(port) as listener, StudioRuns() as runs:
        number = listener.getsockname()[1]
        flights = RecentFlights(runs.folder)
        pages = Pages(token, runs, flights)
        guarded = Guard(pages.application, token, hosts(number))
        options = {"log_level": "critical", "lifespan": "off", "server_header": False, "ws": "none"}
        server = uvicorn.Server(uvicorn.Config(guarded, **options))  # type: ignore[arg-type]
        address = f"http://{ADDRESS}:{number}/{token}/"
        report(f"studio: {address}")
        for prepare in (schema, flights.read_all):  # to show the first form and all cards without delay
            threading.Thread(target=prepare, daemon=True).start()
        webbrowser.open(address)
        asyncio.run(server.serve(sockets=[listener]))


def _listening(port: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((ADDRESS, port))
        listener.listen()
    except OSError as error:
        listener.close()
        raise ValueError(f"--port {port}: {(error.strerror or str(error)).lower()}; choose another") from None
    return listener


Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Message, Receive, Send], Awaitable[None]]

LARGEST = 1_000_000  # [byte] largest request
HEADERS = {  # default headers of all responses
    b"cache-control": b"no-store",
    b"referrer-policy": b"same-origin",  # no-referrer would set the Origin of a form to "null"
    b"x-content-type-options": b"nosniff",
    b"content-security-policy": b"default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    b"frame-src 'self' http://127.0.0.1:*; base-uri 'none'; form-action 'self'; frame-ancestors 'self'",
}


class Guard:
    """ASGI middleware that only accepts requests with the secret, an accepted host and the same origin."""

    def __init__(self, application: Application, token: str, hosts: set[str]):
        """Wrap an application; `hosts` are the accepted values of the header Host, with the port."""
        self._application, self._token, self._hosts = application, token, hosts

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Respond to an HTTP request; others, such as WebSockets, are dropped."""
        if scope["type"] != "http":
            return
        fields = [(key.lower(), value.decode("latin-1")) for key, value in scope["headers"]]
        host = next((value for key, value in fields if key == b"host"), None)
        origins = [value for key, value in fields if key == b"origin"]
        status = rejection(scope["path"], host, origins, self._token, self._hosts)
        length = next((value for key, value in fields if key == b"content-length"), "0")
        if status is None and scope["method"] == "POST":
            if not origins:  # browsers send Origin with each form
                status = http.HTTPStatus.FORBIDDEN
            elif not length.isdecimal() or int(length) > LARGEST or any(k == b"transfer-encoding" for k, _ in fields):
                status = http.HTTPStatus.REQUEST_ENTITY_TOO_LARGE
        if status is not None:
            text = f"{status.phrase}\n".encode()
            start = {"type": "http.response.start", "status": status, "headers": [(b"content-type", b"text/plain")]}
            await send(start)
            await send({"type": "http.response.body", "body": text})
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                present = {key.lower() for key, _ in message["headers"]}
                message["headers"] = [*message["headers"], *((k, v) for k, v in HEADERS.items() if k not in present)]
            await send(message)

        await self._application(scope, receive, send_with_headers)
