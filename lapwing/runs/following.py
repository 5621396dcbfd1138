"""A run in processes followed while it goes on: what is new of it, and what happened, for those who show it."""

from collections.abc import Callable, Iterable

from cosim.setup import Setup
from cosim.watch import Watch
from lapwing.runs.events import event_messages
from messages.topics import EVENTS
from studies.events import Event
from studies.flight import Flight
from studies.live import LiveFlight, new_events

Shows = Callable[[Flight, list[Event]], None]


class Following:
    """Tells of each step of a run; events also go out on their topic, for viewers that are processes of the run."""

    def __init__(self, setup: Setup, shows: Iterable[Shows] = ()):
        """Of a run that is about to begin; each of `shows` is given a step and what happened in it."""
        self._flight, self._after, self._shows = LiveFlight(setup), -1.0, tuple(shows)
        self._services, self._vehicle = set(setup.services), setup.vehicle

    def observe(self, watch: Watch) -> None:
        """Take in what is new in a run that is watched."""
        watch.listen = self._flight.take
        if not watch.spoken >= self._services or (step := self._flight.step(watch.time_ns)) is None:
            return
        happened = new_events(step, self._after)
        self._after = float(step.truth.times[-1])
        for time_ns, payload in event_messages(happened):
            watch.publish(EVENTS.name.format(vehicle=self._vehicle), time_ns, payload)
        for show in self._shows:
            show(step, happened)
