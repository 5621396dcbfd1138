"""Access to the page: by its secret path, from this machine, and from the page itself."""

import http
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from lapwing.studies.local_pages import refusal

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Message, Receive, Send], Awaitable[None]]

LARGEST = 1_000_000  # [byte] of a request
HEADERS = {  # of every answer; a page may set its own policy
    b"cache-control": b"no-store",
    b"referrer-policy": b"same-origin",  # no-referrer would make the origin of a form "null"
    b"x-content-type-options": b"nosniff",
    b"content-security-policy": b"default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    b"frame-src 'self' http://127.0.0.1:*; base-uri 'none'; form-action 'self'; frame-ancestors 'self'",
}


class Guard:
    """ASGI application that passes only requests with the secret, an own host and an own origin."""

    def __init__(self, application: Application, token: str, hosts: set[str]):
        """Guard an application; `hosts` are the accepted values of Host, with the port."""
        self._application, self._token, self._hosts = application, token, hosts

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Answer a request. Anything but HTTP is dropped: there are no WebSockets."""
        if scope["type"] != "http":
            return
        fields = [(key.lower(), value.decode("latin-1")) for key, value in scope["headers"]]
        host = next((value for key, value in fields if key == b"host"), None)
        origins = [value for key, value in fields if key == b"origin"]
        status = refusal(scope["path"], host, origins, self._token, self._hosts)
        length = next((value for key, value in fields if key == b"content-length"), "0")
        if status is None and scope["method"] == "POST":
            if not origins:  # browsers send it with every form
                status = http.HTTPStatus.FORBIDDEN
            elif not length.isdecimal() or int(length) > LARGEST or any(k == b"transfer-encoding" for k, _ in fields):
                status = http.HTTPStatus.REQUEST_ENTITY_TOO_LARGE
        if status is not None:
            text = f"{status.phrase}\n".encode()
            start = {"type": "http.response.start", "status": status, "headers": [(b"content-type", b"text/plain")]}
            await send(start)
            await send({"type": "http.response.body", "body": text})
            return

        async def protected(message: Message) -> None:
            if message["type"] == "http.response.start":
                known = {key.lower() for key, _ in message["headers"]}
                message["headers"] = [*message["headers"], *((k, v) for k, v in HEADERS.items() if k not in known)]
            await send(message)

        await self._application(scope, receive, protected)
