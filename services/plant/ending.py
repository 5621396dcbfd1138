"""How a run ends: at its duration, a while after the mission, or because the numbers do."""

from typing import Any

from dynamics.integrators import not_finite
from messages import Status
from services.lockstep import LockStepError
from services.scene import Scene
from services.sections import Exchange, Run


class Ending:
    """Knows the last tick of a run."""

    def __init__(self, scene: Scene):
        rate = scene[Exchange].rate
        self._last = round(scene[Run].duration * rate)
        self._settle = round(scene[Run].settle * rate)

    def reached(self, tick: int, status: Status | None = None) -> bool:
        """Whether `tick` is the last; once a status says that the mission is finished, that is soon."""
        if status and status.finished:
            self._last = min(self._last, tick + self._settle)
        return tick >= self._last


def diverged(system: str, state: Any, t: float, step: float) -> LockStepError:
    """The error of a state that is not finite at time t [s], with steps of `step` [s]."""
    where = f"{system}: not finite at t = {t:g} s: {not_finite(state)}"
    return LockStepError(f"{where}; take a smaller step than {step:g} s")
