"""The `[solver]` of a scene: the integrator and its step."""

from typing import Any, ClassVar

from pydantic import Field, field_validator

from lapwing.cosim.scene import KeyOrigin, Scene, SceneError, SceneTable
from lapwing.dynamics import integrators
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.vehicles.multirotor import CONTACT_TOLERANCE
from lapwing.services.common.communication_schema import Communication

CONTACT_SHARE = 0.1  # of solver.accuracy, for one part of a step in contact: errors of many parts add up


class Solver(SceneTable):
    """How the plant is integrated between two exchanges."""

    TABLE: ClassVar[str] = "solver"
    integrator: str = "rk4_renormalised"  # a module of lapwing/dynamics/integrators
    step: float = Field(default=0.001, ge=1e-9)  # [s], divides the exchange interval
    accuracy: float | None = Field(default=None, gt=0.0)  # error that step, and integrator unless given, are chosen for

    @field_validator("integrator")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in integrators.names():
            raise ConfigError.unknown("", "integrator", name, integrators.names())
        return name

    def resolved(self) -> dict[str, Any]:
        """As of any table; what is still to be chosen is left out."""
        return self.model_dump(include=self.model_fields_set if self.undecided else None, exclude_none=True)

    @property
    def undecided(self) -> bool:
        """Whether the step, and the integrator unless it is given, are still to be chosen for the accuracy."""
        return self.accuracy is not None and "step" not in self.model_fields_set

    @property
    def contact_tolerance(self) -> float:
        """Error of a part of a step in contact that leaves the accuracy to a whole flight; the usual one without."""
        return CONTACT_TOLERANCE if self.accuracy is None else CONTACT_SHARE * self.accuracy

    def steps(self, exchange: Communication) -> int:
        """Steps in one exchange interval."""
        return round(exchange.interval / self.step)

    def check(self, scene: Scene) -> None:
        """The step divides the exchange interval."""
        if self.undecided:
            return
        interval = scene[Communication].interval
        n = self.steps(scene[Communication])
        if n < 1 or abs(n * self.step - interval) > 1e-9 * interval:
            expected = f"a step that divides the exchange interval of {interval:g} s"
            raise ConfigError("solver.step", f"got {self.step:g} s", expected)


def method(scene: Scene) -> tuple[tuple, int, float]:
    """The scene's integrator for compiled code, its steps in an exchange interval, and the length of one [s].

    Raises:
        SceneError: the scene says an accuracy, and nobody has chosen for it.
    """
    solver, exchange = scene[Solver], scene[Communication]
    if solver.undecided:
        chosen = "what `lapwing run` chooses for it is to be handed to every service"
        message = f"{chosen}: --set solver.integrator=... --set solver.step=..."
        raise SceneError("solver.accuracy", message, source=KeyOrigin(scene.path))
    steps = solver.steps(exchange)
    return integrators.get(solver.integrator).Method(), steps, exchange.interval / steps
