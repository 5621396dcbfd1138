"""What goes into one bundle on its way from one service to another, and how many ticks.

A service all of whose inputs are d ticks old runs ahead of the others by up to d ticks, as the trajectory does. Nobody
waits for its single ticks: what it takes and what it gives goes in bundles of d / 2 ticks. Every loop through it has
those d ticks in it, and the two bundles delay a message by less, so that the lock step cannot come to a stop.

A service that takes only what is due every n ticks gets a bundle every n ticks, as the autopilot the battery's.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.transport.bus_keys import STEP_KEY


def ticks_at_once(setup: RunConfig, name: str) -> int:
    """The ticks that a service steps, and hands over, at once."""
    delays = [i.delay for i in setup.services[name].inputs]
    return max(1, min(delays, default=0) // 2)


class PacketSchedule(NamedTuple):
    """How bundles go from one service to another."""

    ticks: int  # of a bundle
    every: int  # ticks from the first of a bundle to that of the next; only ports whose period is a multiple

    @property
    def key(self) -> str:
        """The key of its bundles, before the name of the service that gives them."""
        if self.ticks > 1:
            return f"{STEP_KEY}_{self.ticks}"
        return STEP_KEY if self.every == 1 else f"{STEP_KEY}_every_{self.every}"

    def ports(self, given: Iterable[Port]) -> list[Port]:
        """Those in its bundles, of what a service gives."""
        return [port for port in given if self.ticks > 1 or port.period % self.every == 0]


EACH_TICK = PacketSchedule(1, 1)
"""A bundle at each tick, of all that a service gives."""


def way(setup: RunConfig, producer: str, consumer: str) -> PacketSchedule:
    """How bundles go from one service to another that takes something of it."""
    if (ticks := max(ticks_at_once(setup, producer), ticks_at_once(setup, consumer))) > 1:
        return PacketSchedule(ticks, ticks)
    taken = {i.port for i in setup.services[consumer].inputs}
    periods = [port.period for port in setup.services[producer].ports if port.name in taken]
    return PacketSchedule(1, math.gcd(*periods))


def ways(setup: RunConfig, producer: str) -> set[PacketSchedule]:
    """How the bundles of a service go; those of one whose rows nobody takes at each tick."""
    given = {port.name for port in setup.services[producer].ports}
    takers = [name for name, service in setup.services.items() if any(i.port in given for i in service.inputs)]
    return {way(setup, producer, taker) for taker in takers} or {EACH_TICK}
