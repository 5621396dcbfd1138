"""The MAVLink links that commands open: checked, and handed on."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from services.mavlink.options import Options


def check_links(urls: list[str] | None, key: Path | None, insecure: bool) -> None:
    """Refuse links that cannot be, before anything is started for them."""
    if not urls:
        if key or insecure:
            raise ValueError(f"{'--mavlink-key' if key else '--insecure'}: expected with --mavlink URL")
        return
    from services.mavlink.channel import read_key
    from services.mavlink.links import check

    for url in urls:
        check(url)
    if key:
        read_key(key)


def mavlink_options(
    urls: list[str] | None, key: Path | None, insecure: bool, log: Path, speed: float | None
) -> "Options":
    """The link that a replay of a log opens."""
    from services.mavlink.channel import read_key
    from services.mavlink.options import Options

    if not urls:
        raise ValueError("--mavlink: expected at least one URL")
    return Options(tuple(urls), read_key(key) if key else None, insecure, log, speed)
