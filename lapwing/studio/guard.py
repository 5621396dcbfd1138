"""Access control of the page: secret path, Host and Origin."""

import http
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from lapwing.studies.local_pages import rejection

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
