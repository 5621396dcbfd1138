"""Systems of dynamics/vehicles that any integrator marches from tick to tick, with everything checked."""

from typing import Any

from dynamics import integrators
from dynamics.cell import Cell
from dynamics.integrators import check_start, march
from dynamics.kernel import kernel
from dynamics.tree import finite
from services.plant.config import Solver, method
from services.plant.ending import diverged
from services.scene import Scene, WrongKeyError
from services.sections import Exchange, Vehicle


@kernel
def forward(method, p, s, t, h, n):
    """March the state in the cell `s` n steps of h [s] from t [s]; the state, and whether it is finite."""
    s.value = march(method, p.value, t, s.value, h, n)
    return s.value, finite(s.value)


def check_marched(scene: Scene, p: Any, start: Any) -> None:
    """Refuse a start that is not sound, and an integrator that is not for such a state.

    Raises:
        ValueError: "key: message", the key relative to the table `vehicle`, or WrongKeyError of another.
    """
    model = scene[Vehicle].model
    try:
        check_start(p, start)
    except ValueError as error:
        raise WrongKeyError(model, str(error)) from None
    name = scene[Solver].integrator
    required = getattr(integrators.get(name), "REQUIRES", start._fields)
    if tuple(required) != start._fields:
        has = ", ".join(start._fields)
        raise WrongKeyError("solver.integrator", f"{name} is for states of {', '.join(required)}; {model} has {has}")


class Marched:
    """The system with parameters p on its way from the state `start`."""

    def __init__(self, scene: Scene, p: Any, start: Any):
        self.parameters, self._state = Cell(p), Cell(start)
        self._model, self._interval = scene[Vehicle].model, scene[Exchange].interval
        self._method, self._steps, self._step = method(scene)

    def to(self, tick: int) -> Any:
        """The state at `tick`, one tick after the last; at tick 0 the start.

        Raises:
            LockStepError: a number of the state is no longer finite.
        """
        t = max(tick - 1, 0) * self._interval
        steps = self._steps if tick > 0 else 0
        state, sound = forward(self._method, self.parameters, self._state, t, self._step, steps)
        if not sound:
            raise diverged(self._model, state, tick * self._interval, self._step)
        return state
