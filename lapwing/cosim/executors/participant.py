"""Participant of a run as a process: joins the other participants on the bus, waits, reports, and leaves."""

import time
from collections.abc import Callable, Collection, Sequence
from typing import TypeVar

from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.config.serialise import compress, decompress, first_difference, from_json, to_json
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_loop import set_compiling
from lapwing.cosim.executors.peer_tracker import PeerTracker
from lapwing.cosim.executors.stop_request import Stopped, StopRequest
from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import (
    ALIVE_KEY,
    COMPILING_KEY,
    CONFIG_KEY,
    HEARD_KEY,
    OUTSIDE_KEY,
    REFUSED_KEY,
    WAITING_KEY,
)
from lapwing.cosim.transport.session_settings import LEASE_MS, limit_silence
from lapwing.kernels import on_compile
from lapwing.messages.topics import Topic

__all__ = ["PATIENCE", "POLL", "Participant", "Stopped"]

POLL = 0.1  # [s] between two checks whether to stop
JOIN_POLL = 0.05  # [s] between two of these checks, and services of a link, while others are absent
OUTSIDE_PERIOD = 0.4  # [s] between two messages about a program outside the run
PATIENCE = 1.0  # [s] of waiting before a service publishes what it waits for
JOIN_TIMEOUT = 600.0  # [s] for the other participants to compile their kernels and to appear
ANSWER_TIMEOUT = 5.0  # [s] for the reply of a participant with its run configuration
CONFIRMED = 60.0  # [s] without a change among the other participants, which confirm a last message
INTERRUPTED = 1.0  # [s] for these confirmations after a request to stop
REPEAT = 0.2  # [s] between two last messages, for late subscribers and links that were cut
BRIEF = 0.02  # [s] between two checks for confirmations
COMPARE_TIME = 3.0  # [s] for all participants to compare their run configurations

T = TypeVar("T")


class Participant(StopRequest):
    """Participant of a run: its bus, its run configuration, and requests to stop."""

    def __init__(
        self,
        name: str,
        config: RunConfig,
        bus: ZenohBus,
        participants: PublisherIds,
        others: list[str],
        speed: float | None = None,
        core: int | None = None,
        compares: Sequence[str] = (),
        realtime: bool = False,
    ):
        """Prepare to join.

        Args:
            name: unique in the run.
            config: run configuration.
            bus: session.
            participants: publisher GIDs of the run.
            others: participants without which the run cannot begin.
            speed: simulated seconds per second; None for as fast as possible.
            core: processor core that all services share with Gauss-Seidel coupling; None for any.
            compares: participants that may have another run configuration, which is compared at joining.
            realtime: True to run in the scheduler's real-time class.
        """
        super().__init__()
        self.compares, self.realtime = compares, realtime
        self.name, self.config, self.bus = name, config, bus
        self.participants, self.key_prefix = participants, participants.key_prefix
        self.others, self.speed, self.core = others, speed, core
        self.create_service: Callable[[str], Service]  # returns a service by name, for its topics
        self._compiling = False
        self._rejected = 0
        self._next_wait_report = 0.0  # [s] of the monotonic clock
        self._peers = PeerTracker(name, others, participants.external)
        self._final_status: list[tuple[str, str]] = []
        on_compile(self._report_compiling)
        self.handle_signals()

    @property
    def packs_ticks(self) -> bool:
        """True if a service that runs ahead sends several ticks in a packet (see `packet_schedule`).

        External services and services on several hosts exchange one tick at a time.
        """
        return not (self.participants.external or self.compares)

    def key(self, topic: Topic) -> str:
        """Return the Zenoh key of a topic in this run."""
        return topic.zenoh_key(self.config.vehicle, self.key_prefix)

    def _report_compiling(self, _: str) -> None:
        if not self._compiling:
            self._compiling = True
            set_compiling(self.name)
            self.publish_status(COMPILING_KEY)

    def publish_status(self, key: str, text: str = "") -> None:
        """Publish a status for the run monitor on a key of the lock step."""
        self.bus.publisher(f"{self.key_prefix}/{key}/{self.name}")(text.encode(), 0)

    def report_external_wait(self, text: str) -> None:
        """Publish, at most every `OUTSIDE_PERIOD`, that a block of this service waits for an external program."""
        now = time.monotonic()
        if now >= self._next_wait_report:
            self._next_wait_report = now + OUTSIDE_PERIOD
            self.publish_status(OUTSIDE_KEY, text)

    def publish_final_status(self, key: str, text: str = "") -> None:
        """Publish a status at the end of this process. `leave` repeats it until all participants have confirmed it."""
        self._final_status.append((key, text))
        self.publish_status(key, text)

    def report_rejected(self) -> None:
        """Publish the number of rejected messages if it has increased."""
        if self.bus.rejected > self._rejected:
            self._rejected = self.bus.rejected
            self.publish_status(REFUSED_KEY, str(self._rejected))

    def stop_without(self, name: str) -> None:
        """Stop when the participant `name`, which monitors the run, has left."""
        self.stop_when_gone(self.bus, f"{self.key_prefix}/{ALIVE_KEY}/{name}")

    def join(self, on_wait: Callable[[], None] = lambda: None) -> None:
        """Declare that this process has subscribed, wait for the other participants, and compare run configurations.

        Args:
            on_wait: called repeatedly during the wait.

        Raises:
            Stopped: requested to stop during the wait.
            LockStepError: a participant did not appear.
            ValueError: another participant has another run configuration; names the first difference.
        """
        self._peers.watch(self.bus, self.key_prefix)  # before its own declaration: others may leave soon after it
        self.bus.answer(f"{self.key_prefix}/{CONFIG_KEY}/{self.name}", compress(self.config))
        self.bus.declare_liveliness(f"{self.key_prefix}/{ALIVE_KEY}/{self.name}")
        self._await(self.others, on_wait)
        limit_silence(LEASE_MS)
        if self.compares:
            self._compare()

    def _await(self, names: Collection[str], on_wait: Callable[[], None]) -> None:
        deadline = time.monotonic() + JOIN_TIMEOUT
        while (absent := self._peers.missing(names)) and not self.stopping:
            on_wait()
            if time.monotonic() > deadline:
                raise LockStepError(f"{self.name}: no participant {', '.join(absent)} within {JOIN_TIMEOUT:g} s")
            self._await_change(JOIN_POLL)
        if self.stopping:
            raise Stopped

    def _compare(self) -> None:
        """Raise ValueError if another participant has another run configuration."""
        own = to_json(self.config)
        for other in self.compares:
            if other == self.name:
                continue
            reply = self.bus.query(f"{self.key_prefix}/{CONFIG_KEY}/{other}", ANSWER_TIMEOUT)
            try:
                if reply is None or (text := decompress(reply)) == own:
                    continue
                difference = first_difference(self.config, from_json(text, self.config.modules))
            except ValueError as error:
                raise ValueError(f"{self.name}: run configuration of {other} cannot be read: {error}") from None
            key, own_value, other_value = difference or ("run configuration", "?", "?")
            if self.name in self.compares:
                time.sleep(COMPARE_TIME)  # answer participants that compare later
            raise ValueError(
                f"{key} is {own_value!r} here but {other_value!r} in {other}; start all services from the same scene"
            )

    def wait_with_status(self, get: Callable[[float], T | None], waiting_for: Callable[[], str]) -> T:
        """Return the first result of `get(timeout)`. Publish the text of `waiting_for` if it takes long.

        Raises:
            Stopped: requested to stop.
        """
        waited = 0.0
        while not self.stopping:
            result = get(POLL)
            if result is not None:
                return result
            waited += POLL
            if waited >= PATIENCE:
                self.publish_status(WAITING_KEY, waiting_for())
                self.report_rejected()
                waited = 0.0
        raise Stopped

    def wait_for_outside(self, get: Callable[[float], T | None], seconds: float, waiting_for: Callable[[], str]) -> T:
        """Return the first result of `get(timeout)`, the answer of a program outside the run.

        Raises:
            Stopped: requested to stop.
            LockStepError: no answer within `seconds`.
        """
        deadline = time.monotonic() + seconds
        while not self.stopping:
            if (result := get(POLL)) is not None:
                return result
            if time.monotonic() > deadline:
                raise LockStepError(f"{self.name}: no answer within {seconds:g} s: {waiting_for()}")
            self.report_external_wait(waiting_for())
        raise Stopped

    def confirm(self) -> None:
        """Declare that this process has received the last message of each participant that it subscribes to.

        The token lives as long as the session, so that a participant whose link was cut receives it later.
        """
        self.bus.declare_liveliness(f"{self.key_prefix}/{HEARD_KEY}/{self.name}")

    def leave(self, repeat: Callable[[], None], key: str = HEARD_KEY, only: Collection[str] | None = None) -> None:
        """Wait until the others have confirmed the last message of this process, or have left.

        Zenoh drops queued messages when a session closes, so no process closes its session earlier. In a supervised run
        the run monitor alone decides that a participant does not confirm: it receives all signs of progress, and knows
        how long processes have waited for a CPU.

        Args:
            repeat: publishes the last message again; called until all have confirmed it.
            key: key of the token that confirms it.
            only: participants that confirm it; None for all.

        Raises:
            LockStepError: names the participants that did not confirm in time, in a run without a run monitor.
        """
        start = last_repeat = last_change = time.monotonic()
        while unconfirmed := self._peers.unconfirmed(key, only, time.monotonic() - start):
            now = time.monotonic()
            if self.stopping and now - start > INTERRUPTED:
                return
            if not self.supervised and now - last_change > CONFIRMED:
                raise LockStepError(f"{self.name}: {', '.join(unconfirmed)} did not confirm its last message")
            if now - last_repeat > REPEAT:
                for status in self._final_status:
                    self.publish_status(*status)
                repeat()
                last_repeat = now
            if self._await_change(BRIEF):
                last_change = now

    def _await_change(self, seconds: float) -> bool:
        """Wait until a participant has appeared, confirmed or left; return False after `seconds`."""
        changed = self._peers.changed.wait(seconds)
        if changed:
            self._peers.changed.clear()
        return changed
