"""Links to endpoints: one file for each kind, selected by the scheme of the URL."""

from functools import cache
from selectors import BaseSelector

from lapwing.dynamics import discovery
from lapwing.services.mavlink.links.link import Link, Receiver

__all__ = ["Link", "check", "for_vehicle_index", "kinds", "open_link"]


@cache
def kinds() -> dict[str, type[Link]]:
    """Return the link classes by URL scheme."""
    classes = [value for module in discovery.modules(__name__).values() for value in vars(module).values()]
    links = [cls for cls in classes if isinstance(cls, type) and issubclass(cls, Link) and cls.SCHEME]
    return {cls.SCHEME: cls for cls in sorted(links, key=lambda cls: cls.SCHEME)}


def check(url: str) -> type[Link]:
    """Return the link class of a URL.

    Raises:
        ValueError: invalid URL; the message lists the forms.
    """
    scheme, _, rest = url.partition(":")
    kind = kinds().get(scheme)
    if kind is None or not kind.fits(rest):
        forms = ", ".join(cls.FORM for cls in kinds().values())
        raise ValueError(f"--mavlink {url}: expected one of {forms}; for example udpout:127.0.0.1:14550")
    return kind


def for_vehicle_index(url: str, i: int) -> str:
    """Return the URL of vehicle i (from 0) if several vehicles share one URL.

    Raises:
        ValueError: the scheme is unknown, or has no URL for so many vehicles.
    """
    kind, (scheme, _, rest) = check(url), url.partition(":")
    try:
        return f"{scheme}:{kind.for_vehicle_index(rest, i)}"
    except ValueError as error:
        raise ValueError(f"--mavlink {url}: {error}") from None


def open_link(url: str, adapter: Receiver, selector: BaseSelector) -> Link:
    """Open the link of a URL.

    Raises:
        ValueError: invalid URL, or the link cannot be opened.
    """
    kind = check(url)
    try:
        return kind(url.partition(":")[2], adapter, selector)
    except OSError as error:
        raise ValueError(f"--mavlink {url}: {(error.strerror or str(error)).lower()}") from None
