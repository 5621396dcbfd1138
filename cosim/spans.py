"""How many ticks go into one bundle on its way from one service to another.

A service all of whose inputs are d ticks old runs ahead of the others by up to d ticks, as the trajectory does. Nobody
waits for its single ticks: what it takes and what it gives goes in bundles of d / 2 ticks. Every loop through it has
those d ticks in it, and the two bundles delay a message by less, so that the lock step cannot come to a stop.
"""

from cosim.keys import STEP_KEY
from cosim.setup import Setup


def ticks_at_once(setup: Setup, name: str) -> int:
    """The ticks that a service steps, and hands over, at once."""
    delays = [i.delay for i in setup.services[name].inputs]
    return max(1, min(delays, default=0) // 2)


def span(setup: Setup, producer: str, consumer: str) -> int:
    """The ticks of a bundle from one service to another."""
    return max(ticks_at_once(setup, producer), ticks_at_once(setup, consumer))


def spans(setup: Setup, producer: str) -> set[int]:
    """Those of the bundles that a service gives; of one whose rows nobody takes, a tick."""
    given = {port.name for port in setup.services[producer].ports}
    takers = [name for name, service in setup.services.items() if any(i.port in given for i in service.inputs)]
    return {span(setup, producer, taker) for taker in takers} or {1}


def step_key(ticks: int) -> str:
    """The key, before the name of a service, of its bundles of so many ticks."""
    return STEP_KEY if ticks == 1 else f"{STEP_KEY}_{ticks}"
