"""Which services of a run its launcher starts again, how often, and what is told of it."""

import json
import subprocess
from collections.abc import Callable, Iterable, Mapping

from lapwing.cosim.processes.forked_process import Forked
from lapwing.cosim.processes.run_monitor import MONITOR, STALL, RunMonitor
from lapwing.cosim.transport.bus_keys import RESTARTED_KEY

MOST = 3  # of one service in a run: what is killed again and again has a reason that a restart does not mend


class Restarts:
    """Those of one run.

    Attributes:
        begun: the services that have been started again.
    """

    def __init__(self, journals: Mapping[str, int], say: Callable[[str], None]):
        """Services by name.

        Args:
            journals: the open file of each one's journal (`lapwing.cosim.transport.input_journal`).
            say: is given a line for the user.
        """
        self._journals, self._say = dict(journals), say
        self.begun: set[str] = set()
        self._left = dict.fromkeys(journals, MOST)
        self._reasons: dict[str, str] = {}  # of those that the launcher has killed
        self._told: list[tuple[float, str]] = []  # time [s] and what happened

    def journal(self, name: str) -> tuple[int, ...]:
        """The open file of its journal, none for a service that is not started again."""
        return (self._journals[name],) if name in self._journals else ()

    def may(self, names: Iterable[str]) -> bool:
        """Whether all of these may be started again."""
        return all(self._left.get(name, 0) > 0 for name in names)

    def stop(self, name: str, child: subprocess.Popen | Forked) -> None:
        """Kill a service that is stopped, so that it can be started again."""
        self._reasons[name] = f"stopped for {STALL:g} s"
        child.kill()
        child.wait()

    def begin(self, name: str, code: int, watch: RunMonitor) -> bool:
        """Whether a service that has ended with this code is to be started again; tells everybody if it is."""
        if code >= 0 or watch.diverged or not self.may([name]):
            return False
        self._left[name] -= 1
        reason, time = self._reasons.pop(name, f"killed (signal {-code})"), watch.time_ns * 1e-9
        self._say(f"{name} was {reason} at t = {time:.3f} s, and is started again")
        self._told.append((time, f"{name} was {reason}, and is started again"))
        watch.publish(f"{RESTARTED_KEY}/{MONITOR}", watch.time_ns, json.dumps(self._told).encode())
        watch.forget(name)
        self.begun.add(name)
        return True
