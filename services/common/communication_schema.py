"""When services exchange messages: the tick of the run, and the rates that are made of it."""

from typing import ClassVar, Literal

from pydantic import Field

from lapwing.cosim.scene import Scene, SceneTable
from lapwing.dynamics.config_error import ConfigError
from lapwing.messages.topics import Topic


class Communication(SceneTable):
    """The communication step: how often services exchange messages, and whether the command closes the loop at once."""

    TABLE: ClassVar[str] = "exchange"
    SHARED: ClassVar[bool] = True
    rate: int = Field(default=250, gt=0, le=10_000)  # [Hz] one tick is 1/rate
    coupling: Literal["sequential", "parallel"] = "sequential"  # Gauss-Seidel, or Jacobi: services overlap

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
        """Ticks after which the plant applies a command: at once, or one exchange later so that services overlap."""
        return 1 if self.coupling == "sequential" else 2

    def check(self, scene: Scene) -> None:
        """A tick is a whole number of nanoseconds."""
        if 1_000_000_000 % self.rate:
            expected = "a rate whose interval is a whole number of ns (100, 125, 200, 250, 400, 500, 1000, ...)"
            raise ConfigError("exchange.rate", f"got {self.rate} Hz", expected)


class Rates(SceneTable):
    """How often derived messages are published [Hz], at the most once a tick; each divides exchange.rate."""

    TABLE: ClassVar[str] = "rates"
    SHARED: ClassVar[bool] = True
    pose: int = Field(default=50, gt=0)  # [Hz] pose, odometry, transform and clock
    estimate: int = Field(default=50, gt=0)  # [Hz] what the autopilot takes for the state
    status: int = Field(default=10, gt=0)  # [Hz] phase, armed, landed, failures
    battery: int = Field(default=10, gt=0)  # [Hz] charge, voltage, current
    bodies: int = Field(default=50, gt=0)  # [Hz] the single bodies of a vehicle that has several
    operator: int = Field(default=50, gt=0)  # [Hz] what comes from outside, and the answers
    contact: int | None = Field(default=None, gt=0)  # [Hz] forces on every foot of a multirotor; without it, not told

    def check(self, scene: Scene) -> None:
        """Every rate divides the exchange rate."""
        for key in type(self).model_fields:
            if (rate := getattr(self, key)) is not None:
                ticks(scene, min(rate, scene[Communication].rate), f"rates.{key}")


def ticks(scene: Scene, rate: float, key: str) -> int:
    """Ticks between messages of `rate` [Hz].

    Raises:
        KeyedError: the rate, which is that of `key`, does not divide the exchange rate.
    """
    exchange = scene[Communication].rate
    if rate <= 0 or exchange % rate:
        divisors = ", ".join(str(exchange // n) for n in range(1, 51) if exchange % n == 0)
        raise ConfigError(key, f"got {rate:g}", f"a rate that divides exchange.rate = {exchange} Hz ({divisors})")
    return int(exchange // rate)


def period(scene: Scene, topic: Topic) -> int:
    """Ticks between two messages of a topic: its rate is the scene key that the topic table names."""
    if topic.rate is None:
        return 1
    return ticks(scene, min(scene.lookup(topic.rate), scene[Communication].rate), topic.rate)
