"""Lapwing: co-simulation of multirotors.

```python
import lapwing

scene = lapwing.load_scene("delivery_mission", {"effects.random_wind_force.mean": (3.0, 1.0, 0.0)})
flight = lapwing.fly(scene, seed=7)
flight.rmse, flight.truth.position, flight.report("flight.html")
```

The names here are the public interface; each is imported at its first use.
"""

TYPE_CHECKING = False  # True for type checkers: `lapwing` imports nothing before it handles Ctrl-C
if TYPE_CHECKING:
    from lapwing.api.batch_simulator import BatchSimulator, BatchState
    from lapwing.api.flight import Flight
    from lapwing.api.functions import campaign, fly, load_scene, read_log
    from lapwing.api.simulator import Observation, Simulator
    from lapwing.cosim.run_errors import LockStepError
    from lapwing.cosim.scene import Scene, SceneError
    from lapwing.flights.flight_events import Event
    from lapwing.flights.outcome import FlightOutcome
    from lapwing.services.common.ports import Setpoint
    from lapwing.studies.campaign.distributions import choice, linspace, lognormal, loguniform, normal, uniform
    from lapwing.studies.campaign.posterior import posterior

_NAMES = {
    "lapwing.api.functions": ("campaign", "fly", "load_scene", "read_log"),
    "lapwing.api.batch_simulator": ("BatchSimulator", "BatchState"),
    "lapwing.cosim.run_errors": ("LockStepError",),
    "lapwing.cosim.scene": ("Scene", "SceneError"),
    "lapwing.api.flight": ("Flight",),
    "lapwing.services.common.ports": ("Setpoint",),
    "lapwing.api.simulator": ("Observation", "Simulator"),
    "lapwing.studies.campaign.distributions": ("choice", "linspace", "lognormal", "loguniform", "normal", "uniform"),
    "lapwing.studies.campaign.posterior": ("posterior",),
    "lapwing.flights.flight_events": ("Event",),
    "lapwing.flights.outcome": ("FlightOutcome",),
}
_WHERE = {name: module for module, names in _NAMES.items() for name in names}

__all__ = [
    "BatchSimulator",
    "BatchState",
    "Event",
    "Flight",
    "FlightOutcome",
    "LockStepError",
    "Observation",
    "Scene",
    "SceneError",
    "Setpoint",
    "Simulator",
    "campaign",
    "choice",
    "fly",
    "linspace",
    "load_scene",
    "lognormal",
    "loguniform",
    "normal",
    "posterior",
    "read_log",
    "uniform",
]


def __getattr__(name: str) -> object:
    """Import a public name when it is first used: `lapwing --help` needs none of them."""
    import importlib

    if name not in _WHERE:
        raise AttributeError(f"module 'lapwing' has no attribute {name!r}")
    return getattr(importlib.import_module(_WHERE[name]), name)


def __dir__() -> list[str]:
    return __all__
