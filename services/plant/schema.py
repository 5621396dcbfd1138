"""The `[solver]` table of a scene: integrator and step."""

from typing import Any, ClassVar

from pydantic import Field, field_validator

from lapwing.cosim.scene import KeyOrigin, Scene, SceneError, SceneTable
from lapwing.dynamics import integrators
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.vehicles.multirotor import CONTACT_TOLERANCE
from lapwing.kernels import math
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.vehicle_schema import Vehicle

CONTACT_SHARE = 3e-5  # fraction of solver.accuracy, for a substep in contact: bounces amplify its errors
MANY_SUBSTEPS = 1e-4  # accuracy below which the share decreases with the number of substeps, as its fifth root
LEAST_CONTACT_TOLERANCE = 1e-15  # below it a difference of two substeps is round-off, and no substep is short enough

# accuracies below which substeps are limited by round-off, by effect or model
LEAST_ACCURACIES = {"ground_contact": 4e-10, "unloading": 6.7e-9, "shared_slung_load": 2e-8}

PART_SHARE, PART_TOLERANCE = 1.5e-5, 1e-5  # for systems with their own contacts; tolerance without an accuracy


def contact_tolerance(accuracy: float) -> float:
    """Return the tolerance of a substep in contact for the accuracy of an entire flight."""
    share = CONTACT_SHARE * math.pow(min(1.0, accuracy / MANY_SUBSTEPS), 0.2)
    return max(share * accuracy, LEAST_CONTACT_TOLERANCE)


class Solver(SceneTable):
    """Integration of the plant within a communication step. `accuracy` bounds the error of its state after 1 to 2 s of
    given motor commands; `lapwing accuracy SCENE` also has the errors by the rates of sensors and autopilot.
    """

    TABLE: ClassVar[str] = "solver"
    integrator: str = "rk4_renormalised"  # method of integration
    step: float = Field(default=0.001, ge=1e-9)  # [s], divides the communication step
    accuracy: float | None = Field(default=None, ge=1e-12)  # largest error relative to 1 + size; selects both others

    @field_validator("integrator")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in integrators.names():
            raise ConfigError.unknown("", "integrator", name, integrators.names())
        return name

    def resolved(self) -> dict[str, Any]:
        """Return the table without undecided values."""
        return self.model_dump(include=self.model_fields_set if self.undecided else None, exclude_none=True)

    @property
    def undecided(self) -> bool:
        """True if step or integrator are still to be selected for the accuracy."""
        return self.accuracy is not None and "step" not in self.model_fields_set

    @property
    def contact_tolerance(self) -> float:
        """Tolerance of a substep in contact; the default one without an accuracy."""
        return CONTACT_TOLERANCE if self.accuracy is None else contact_tolerance(self.accuracy)

    @property
    def part_tolerance(self) -> float:
        """Tolerance of a substep of systems other than multirotors (`integrate_step_doubling`)."""
        if self.accuracy is None:
            return PART_TOLERANCE
        return max(PART_SHARE * self.accuracy, integrators.LEAST_TOLERANCE)

    def steps(self, exchange: Communication) -> int:
        """Return the integrator steps per communication step."""
        return round(exchange.interval / self.step)

    def check(self, scene: Scene) -> None:
        """Check that the step divides the communication step."""
        if self.undecided:
            return
        interval = scene[Communication].interval
        n = self.steps(scene[Communication])
        if n < 1 or abs(n * self.step - interval) > 1e-9 * interval:
            expected = f"a step that divides the communication step of {interval:g} s"
            raise ConfigError("solver.step", f"got {self.step:g} s", expected)


def accuracy_to_select_for(scene: Scene) -> float | None:
    """Return the smallest accuracy of a scene's vehicles; None if one of them sets a step, or no accuracy."""
    solvers = [vehicle[Solver] for vehicle in scene.each_vehicle]
    return min(s.accuracy or math.inf for s in solvers) if all(s.undecided for s in solvers) else None


def limited_by_round_off(scene: Scene) -> tuple[str, float] | None:
    """Return (name, accuracy) of the part of a vehicle that cannot meet its accuracy in contact; None if all can."""
    names = {*scene.tables("effects"), scene[Vehicle].model}
    name = max(names & LEAST_ACCURACIES.keys(), key=LEAST_ACCURACIES.__getitem__, default=None)
    accuracy = scene[Solver].accuracy
    if name is None or accuracy is None or accuracy >= LEAST_ACCURACIES[name]:
        return None
    return name, LEAST_ACCURACIES[name]


def method(scene: Scene) -> tuple[tuple, int, float]:
    """Return the compiled integrator, its steps per communication step, and the step [s].

    Raises:
        SceneError: the scene has an accuracy without a selected solver.
    """
    solver, exchange = scene[Solver], scene[Communication]
    if solver.undecided:
        message = "no solver is selected; override solver.integrator and solver.step with those of `lapwing run`"
        raise SceneError("solver.accuracy", message, source=KeyOrigin(scene.path))
    steps = solver.steps(exchange)
    return integrators.get(solver.integrator).Method(), steps, exchange.interval / steps
