"""The `[solver]` of a scene: the integrator and its step."""

from typing import ClassVar

from pydantic import Field, field_validator

from dynamics import integrators
from services.scene import Scene, Section
from services.sections import Exchange


class Solver(Section):
    """How the plant is integrated between two exchanges."""

    TABLE: ClassVar[str] = "solver"
    integrator: str = "rk4_renormalised"
    step: float = Field(default=0.001, gt=0.0)  # [s], divides the exchange interval

    @field_validator("integrator")
    @classmethod
    def _known(cls, name: str) -> str:
        integrators.get(name)
        return name

    def steps(self, exchange: Exchange) -> int:
        """Steps in one exchange interval."""
        return round(exchange.interval / self.step)

    def check(self, scene: Scene) -> None:
        """The step divides the exchange interval."""
        interval = scene[Exchange].interval
        n = self.steps(scene[Exchange])
        if n < 1 or abs(n * self.step - interval) > 1e-9 * interval:
            raise ValueError(
                f"step: expected a step that divides the exchange interval of {interval:g} s, got {self.step:g} s"
            )


def method(scene: Scene) -> tuple[tuple, int, float]:
    """The scene's integrator for compiled code, its steps in an exchange interval, and the length of one [s]."""
    solver, exchange = scene[Solver], scene[Exchange]
    steps = solver.steps(exchange)
    return integrators.get(solver.integrator).Method(), steps, exchange.interval / steps
