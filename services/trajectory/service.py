"""The trajectory as a service: the setpoint of every tick, a bounded time ahead of the plant."""

from collections.abc import Iterator
from typing import Any

from messages import Clock, Setpoint, Vector3, header
from messages.topics import CLOCK, TRAJECTORY, Topic
from services.lockstep import Input
from services.scene import Scene
from services.sections import Exchange, follows_trajectory, start_height
from services.trajectory.config import Trajectory as Spec
from services.trajectory.mission import compile
from services.trajectory.piece import Parameters, evaluate

LEAD = 0.1  # [s] the setpoints are ahead of the clock at the most


def create(scene: Scene) -> "Trajectory | None":
    """The signal builder of the scene's `[trajectory]`; None where nobody flies along one."""
    return Trajectory(scene) if follows_trajectory(scene) else None


class Trajectory:
    """Evaluates the compiled trajectory tick by tick."""

    outputs = (TRAJECTORY,)

    def __init__(self, scene: Scene):
        exchange = scene[Exchange]
        self.inputs = (Input(CLOCK, max(1, round(LEAD * exchange.rate))),)
        self._interval, self._interval_ns = exchange.interval, exchange.interval_ns
        compiled = compile(scene[Spec], (0.0, 0.0, start_height(scene)), folder=scene.path.parent)
        self._parameters, self._phases, self._final = compiled.parameters, compiled.phases, compiled.final

    @property
    def core(self) -> tuple[Parameters, int]:
        """What a compiled closed loop evaluates instead of `step`, and the phase that is final."""
        return self._parameters, self._final

    def prepare(self) -> None:
        """Compile or load the kernel."""
        evaluate(self._parameters, 0.0)

    def step(self, tick: int, clock: Clock | None) -> Iterator[tuple[Topic, Any]]:
        """The setpoint at `tick`."""
        r = evaluate(self._parameters, tick * self._interval)
        yield (
            TRAJECTORY,
            Setpoint(
                header(tick * self._interval_ns, "world"),
                Vector3(*r.position_world),
                Vector3(*r.velocity_world),
                Vector3(*r.acceleration_world),
                r.yaw,
                r.yaw_rate,
                self._phases[r.phase],
                r.phase >= self._final,
            ),
        )
