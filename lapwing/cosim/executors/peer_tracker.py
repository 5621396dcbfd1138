"""Presence of the other participants of a run, and their confirmations of last messages."""

import threading
from collections.abc import Collection, Iterable

from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import ALIVE_KEY, HEARD_KEY, LOGGED_KEY

EXTERNAL_GRACE = 2.0  # [s] for an external service to leave after the end: it confirms nothing


class PeerTracker:
    """Participants that are present, and the confirmations that they have declared.

    Attributes:
        changed: set after each change.
    """

    def __init__(self, name: str, others: Iterable[str], external: Iterable[str]):
        """Track `others` as present from the start, since the run cannot begin without them.

        Args:
            name: name of the participant that tracks.
            others: required participants.
            external: services that external programs run.
        """
        self._name, self._external = name, set(external)
        self._present = set(others) - {name}
        self._seen = {name}  # participants that have been present
        self._confirmed: dict[str, set[str]] = {}  # names of participants by the key of their token
        self.changed = threading.Event()

    def watch(self, bus: ZenohBus, key_prefix: str) -> None:
        """Follow the tokens of the participants on the bus."""
        bus.watch_liveliness(f"{key_prefix}/{ALIVE_KEY}/*", self._note_presence)
        for key in (HEARD_KEY, LOGGED_KEY):
            bus.watch_liveliness(f"{key_prefix}/{key}/*", self._note_confirmation)

    def missing(self, names: Iterable[str]) -> list[str]:
        """Return those of these participants that have never been present.

        One that has left counts as seen: on a busy machine a participant may look after the run has ended.
        """
        return sorted(set(names) - self._seen)

    def unconfirmed(self, key: str, only: Collection[str] | None, waited: float) -> list[str]:
        """Return the names of the present participants that have not declared the token `key`.

        Args:
            key: `HEARD_KEY` or `LOGGED_KEY`.
            only: participants that declare it; None for all.
            waited: [s] since the last message; external services are left out after `EXTERNAL_GRACE`.
        """
        late = self._present.copy() - self._confirmed.get(key, set())
        if only is not None:
            late &= set(only)
        return sorted(late - self._external if waited > EXTERNAL_GRACE else late)

    def _note_presence(self, key: str, alive: bool) -> None:
        name = key.rpartition("/")[2]
        if not alive:
            self._present.discard(name)
        elif name != self._name:
            self._seen.add(name)
            self._present.add(name)
        self.changed.set()

    def _note_confirmation(self, key: str, alive: bool) -> None:
        head, name = key.split("/")[-2:]
        if alive:
            self._confirmed.setdefault(head, set()).add(name)
        self.changed.set()
