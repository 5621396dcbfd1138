"""Endpoints and links that commands open: checked, and handed on."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lapwing.services.mavlink.link_options import Options


def check_endpoints(option: str, endpoints: Iterable[str], keys: Path | None, insecure: bool) -> None:
    """Refuse Zenoh endpoints at which nobody has to prove who he is, unless that is asked for."""
    for endpoint in endpoints:
        kind = endpoint.partition("/")[0]
        if kind == "tls" and not keys:
            raise ValueError(f"{option} {endpoint}: expected --keys FOLDER with it; `lapwing keys FOLDER` makes one")
        if kind not in ("tls", "unixsock-stream") and not insecure:
            expected = "expected tls/HOST:PORT with --keys FOLDER, or --insecure"
            raise ValueError(f"{option} {endpoint}: anybody could join there: {expected}")


def check_published(option: str, endpoint: str, insecure: bool) -> None:
    """Refuse a Zenoh endpoint that other machines reach, and at which nobody proves who he is, unless asked for."""
    from lapwing.runs.distributed_run import check_endpoint
    from lapwing.services.common.address import is_loopback

    check_endpoint(option, endpoint)
    kind, _, address = endpoint.partition("/")
    if kind != "unixsock-stream" and not is_loopback(address.rpartition(":")[0].strip("[]")) and not insecure:
        expected = "expected an address of this machine alone, tcp/127.0.0.1:7447, or --insecure"
        raise ValueError(f"{option} {endpoint}: anybody could listen there: {expected}")


def check_external(texts: Iterable[str], insecure: bool) -> None:
    """Refuse programs of the user's own at endpoints where another could stand in their place, unless asked for."""
    for text in texts:
        if "=unixsock-stream/" not in text and not insecure:
            expected = "expected unixsock-stream/PATH in a folder of your own, or --insecure"
            raise ValueError(f"--external {text}: whoever listens there first is taken for the program: {expected}")


def check_links(urls: list[str] | None, key: Path | None) -> None:
    """Refuse MAVLink links that cannot be, and a file of a passphrase for none, before anything is started for them."""
    if not urls:
        if key:
            raise ValueError("--mavlink-key: expected with --mavlink URL")
        return
    from lapwing.services.mavlink.links import check
    from lapwing.services.mavlink.signing import read_key

    for url in urls:
        check(url)
    if key:
        read_key(key)


def check_ros2(domain: int | None, router: str | None, insecure: bool) -> str:
    """The router of a ROS 2 graph, "" where none is asked for; refuses one that cannot be."""
    if domain is None:
        if router is not None:
            raise ValueError(f"--ros2-router {router}: expected with --ros2 DOMAIN")
        return ""
    from lapwing.services.ros2.node import ROUTER, parse_router

    parse_router(router or ROUTER, insecure)
    return router or ROUTER


def mavlink_options(
    urls: list[str] | None, key: Path | None, insecure: bool, log: Path, speed: float | None
) -> "Options":
    """The link that a replay of a log opens."""
    from lapwing.services.mavlink.link_options import Options
    from lapwing.services.mavlink.signing import read_key

    if not urls:
        raise ValueError("--mavlink: expected at least one URL")
    return Options(tuple(urls), read_key(key) if key else None, insecure, log, speed=speed)
