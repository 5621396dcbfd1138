"""The MAVLink links that commands open: checked, and handed on."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from services.mavlink.hub import Options


def mavlink_arguments(urls: list[str] | None, key: Path | None, insecure: bool) -> list[str]:
    """The arguments that start the service mavlink; none without a URL. What cannot be is refused now."""
    if not urls:
        if key or insecure:
            raise ValueError(f"{'--mavlink-key' if key else '--insecure'}: expected with --mavlink URL")
        return []
    from services.mavlink.channel import read_key
    from services.mavlink.links import check

    for url in urls:
        check(url)
    if key:
        read_key(key)
    arguments = [part for url in urls for part in ("--mavlink", url)]
    return [*arguments, *(["--mavlink-key", str(key)] if key else []), *(["--insecure"] if insecure else [])]


def mavlink_options(urls: list[str] | None, key: Path | None, insecure: bool, speed: float | None) -> "Options":
    """The link that a service or a replay opens."""
    from services.mavlink.channel import read_key
    from services.mavlink.hub import Options

    if not urls:
        raise ValueError("--mavlink: expected at least one URL")
    return Options(tuple(urls), read_key(key) if key else None, insecure, speed)
