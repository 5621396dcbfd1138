"""How a message of the telemetry is declared: its name, its rates, and the function that builds it."""

from collections.abc import Callable
from typing import Any, NamedTuple

from services.mavlink.dialect import id_of
from services.mavlink.vehicle import Vehicle

Builder = Callable[[Vehicle], Any]  # the message, or None while there is nothing to say


class Stream(NamedTuple):
    """A message that is sent again and again, or on request only where its rates are 0."""

    name: str
    ground: float  # [Hz] to a ground station, as PX4 sends it there
    onboard: float  # [Hz] to a companion computer
    build: Builder


STREAMS: dict[int, Stream] = {}
"""Every stream by the number of its message: what the dialect lacks is not here."""


def stream(name: str, ground: float = 0.0, onboard: float | None = None) -> Callable[[Builder], Builder]:
    """Declare the builder of a message; `onboard` is `ground` where it is left out."""

    def declare(build: Builder) -> Builder:
        number = id_of(name)
        if number is not None:
            STREAMS[number] = Stream(name, ground, ground if onboard is None else onboard, build)
        return build

    return declare
