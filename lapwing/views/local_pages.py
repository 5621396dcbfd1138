"""Access control of pages served on this machine: secret path, Host and Origin."""

import http
import secrets
from collections.abc import Collection

ADDRESS = "127.0.0.1"
HOSTS = (ADDRESS, "localhost")


def hosts(port: int) -> set[str]:
    """Return the accepted values of the header Host."""
    return {f"{host}:{port}" for host in HOSTS}


def rejection(
    path: str, host: str | None, origins: Collection[str], token: str, known: Collection[str]
) -> http.HTTPStatus | None:
    """Return the status with which a request is rejected, or None if it is accepted.

    Args:
        path: path of the request, whose first part is the secret.
        host: value of the header Host; None without one.
        origins: values of all headers Origin.
        token: the secret; "" rejects every path.
        known: accepted hosts with their port.
    """
    if host not in known or any(not o.startswith("http://") or o[len("http://") :] not in known for o in origins):
        return http.HTTPStatus.FORBIDDEN
    first = path.partition("?")[0].strip("/").split("/")[0]
    matches = bool(token) and secrets.compare_digest(first.encode(), token.encode())
    return None if matches else http.HTTPStatus.NOT_FOUND
