"""Where partners are met: a kind of link a file, found by the first word of its URL."""

import importlib
import pkgutil
from selectors import BaseSelector

from services.mavlink.adapter import Adapter
from services.mavlink.links.link import Link

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")


def _kinds(base: type[Link]) -> dict[str, type[Link]]:
    found = {base.SCHEME: base} if base.SCHEME else {}
    for cls in base.__subclasses__():
        found |= _kinds(cls)
    return found


KINDS = dict(sorted(_kinds(Link).items()))
"""Class by the first word of a URL."""


def check(url: str) -> type[Link]:
    """The kind of link that a URL names.

    Raises:
        ValueError: none; the text lists the forms.
    """
    scheme, _, rest = url.partition(":")
    kind = KINDS.get(scheme)
    if kind is None or not kind.fits(rest):
        forms = ", ".join(cls.FORM for cls in KINDS.values())
        raise ValueError(f"--mavlink {url}: expected one of {forms}; for example udpout:127.0.0.1:14550")
    return kind


def open_link(url: str, adapter: Adapter, selector: BaseSelector) -> Link:
    """Open the link of a URL.

    Raises:
        ValueError: no such kind, or it cannot be opened.
    """
    kind = check(url)
    try:
        return kind(url.partition(":")[2], adapter, selector)
    except OSError as error:
        raise ValueError(f"--mavlink {url}: {(error.strerror or str(error)).lower()}") from None
