"""Checks of the Zenoh endpoints that commands open."""

from collections.abc import Iterable
from pathlib import Path


def check_endpoints(option: str, endpoints: Iterable[str], keys: Path | None, insecure: bool) -> None:
    """Raise ValueError for a Zenoh endpoint without authentication, unless `insecure`."""
    for endpoint in endpoints:
        kind = endpoint.partition("/")[0]
        if kind == "tls" and not keys:
            raise ValueError(
                f"{option} {endpoint}: needs certificates; use --keys FOLDER (made by `lapwing certificates FOLDER`)"
            )
        if kind not in ("tls", "unixsock-stream") and not insecure:
            expected = "use tls/HOST:PORT with --keys FOLDER, or --insecure"
            raise ValueError(f"{option} {endpoint}: endpoint is not authenticated; {expected}")


def check_published(option: str, endpoint: str, insecure: bool) -> None:
    """Raise ValueError for a Zenoh endpoint that other machines can reach without authentication."""
    from lapwing.runs.distributed_run import check_endpoint
    from lapwing.services.common.address import is_loopback

    check_endpoint(option, endpoint)
    kind, _, address = endpoint.partition("/")
    if kind != "unixsock-stream" and not is_loopback(address.rpartition(":")[0].strip("[]")) and not insecure:
        expected = "use a loopback address, e.g. tcp/127.0.0.1:7447, or --insecure"
        raise ValueError(f"{option} {endpoint}: endpoint is not authenticated; {expected}")


def check_external(texts: Iterable[str], insecure: bool) -> None:
    """Raise ValueError for an external service at an endpoint that other users could occupy, unless `insecure`."""
    for text in texts:
        if "=unixsock-stream/" not in text and not insecure:
            expected = "use unixsock-stream/PATH in a folder of your own, or --insecure"
            raise ValueError(f"--external {text}: endpoint is not authenticated; {expected}")
