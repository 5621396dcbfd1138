"""Communication step of a run and message rates derived from it."""

from typing import ClassVar, Literal

from pydantic import Field

from lapwing.cosim.scene import Scene, SceneTable
from lapwing.dynamics.config_error import ConfigError


class Communication(SceneTable):
    """Communication step between services and coupling of the control loop."""

    TABLE: ClassVar[str] = "communication"
    SHARED: ClassVar[bool] = True
    rate: int = Field(default=250, gt=0, le=10_000)  # [Hz] one tick is 1/rate
    coupling: Literal["gauss_seidel", "jacobi"] = "gauss_seidel"  # jacobi: services overlap, 1 tick more delay

    @property
    def interval_ns(self) -> int:
        """Length of one tick [ns]."""
        return 1_000_000_000 // self.rate

    @property
    def interval(self) -> float:
        """Length of one tick [s]."""
        return 1.0 / self.rate

    @property
    def loop_delay(self) -> int:
        """Delay of the plant's command input [ticks]; one more with Jacobi coupling."""
        return 1 if self.coupling == "gauss_seidel" else 2

    def check(self, scene: Scene) -> None:
        """Raise ConfigError unless a tick is a whole number of nanoseconds."""
        if 1_000_000_000 % self.rate:
            expected = "a rate with a whole number of ns per tick (100, 125, 200, 250, 400, 500, 1000, ...)"
            raise ConfigError("communication.rate", f"got {self.rate} Hz", expected)


class Rates(SceneTable):
    """Publication rates of derived messages [Hz], at most one message a tick; each divides communication.rate."""

    TABLE: ClassVar[str] = "rates"
    SHARED: ClassVar[bool] = True
    pose: int = Field(default=50, gt=0)  # [Hz] pose, odometry, transform and clock
    estimate: int = Field(default=50, gt=0)  # [Hz] state estimate of the autopilot
    covariance: int = Field(default=1, gt=0)  # [Hz] full covariance of the estimate, with normalised innovations
    status: int = Field(default=10, gt=0)  # [Hz] phase, armed, landed, failures; at every change, too
    battery: int = Field(default=10, gt=0)  # [Hz] charge, voltage, current
    body_states: int = Field(default=50, gt=0)  # [Hz] states of the bodies of a multibody vehicle
    commands: int = Field(default=50, gt=0)  # [Hz] external commands and their acknowledgements
    contact_forces: int | None = Field(default=None, gt=0)  # [Hz] forces on each foot; unset: not published

    def check(self, scene: Scene) -> None:
        """Raise ConfigError unless every rate divides communication.rate."""
        for key in type(self).model_fields:
            if (rate := getattr(self, key)) is not None:
                ticks(scene, min(rate, scene[Communication].rate), f"rates.{key}")


def ticks(scene: Scene, rate: float, key: str) -> int:
    """Return the ticks between messages at `rate` [Hz].

    Raises:
        ConfigError: the rate of `key` does not divide communication.rate.
    """
    exchange = scene[Communication].rate
    if rate <= 0 or exchange % rate:
        divisors = ", ".join(str(exchange // n) for n in range(1, 51) if exchange % n == 0)
        raise ConfigError(key, f"got {rate:g}", f"a rate that divides communication.rate = {exchange} Hz ({divisors})")
    return int(exchange // rate)
