"""Declaration of telemetry messages: name, rates, builder."""

from collections.abc import Callable
from typing import Any, NamedTuple

from lapwing.services.common.mavlink.dialect import id_of
from lapwing.services.mavlink.vehicle_cache import VehicleCache

Builder = Callable[[VehicleCache], Any]  # returns a message, None, or a list of messages


class Stream(NamedTuple):
    """Message that is sent periodically, or on request only if its rates are 0."""

    name: str
    ground: float  # [Hz] to a ground station, as in PX4
    onboard: float  # [Hz] to a companion computer
    build: Builder

    def messages(self, vehicle: VehicleCache) -> list[Any]:
        """Return the current messages."""
        return as_list(self.build(vehicle))


def as_list(result: Any) -> list[Any]:
    """Return the messages of a builder's result."""
    if result is None:
        return []
    return result if isinstance(result, list) else [result]


STREAMS: dict[int, Stream] = {}
"""Streams by message id, without messages that the dialect lacks."""


RequestBuilder = Callable[[VehicleCache, float], list[Any]]  # returns the messages for parameter 2 of the request

ON_REQUEST: dict[int, RequestBuilder] = {}
"""Messages that are sent on request only and depend on a parameter of it, by number."""


def on_request(name: str) -> Callable[[RequestBuilder], RequestBuilder]:
    """Declare the builder of messages that the second parameter of a request selects."""

    def declare(build: RequestBuilder) -> RequestBuilder:
        number = id_of(name)
        if number is not None:
            ON_REQUEST[number] = build
        return build

    return declare


def stream(name: str, ground: float = 0.0, onboard: float | None = None) -> Callable[[Builder], Builder]:
    """Declare the builder of a message; `onboard` defaults to `ground`."""

    def declare(build: Builder) -> Builder:
        number = id_of(name)
        if number is not None:
            STREAMS[number] = Stream(name, ground, ground if onboard is None else onboard, build)
        return build

    return declare
