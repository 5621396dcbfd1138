"""Lapwing: co-simulation of multirotors.

```python
import lapwing

scene = lapwing.load("delivery_mission", {"effects.wind_random.mean": (3.0, 1.0, 0.0)})
flight = lapwing.fly(scene, seed=7)
flight.rmse, flight.truth.position, flight.report("flight.html")
```

What is named here is the public interface; everything is imported when it is first asked for.
"""

TYPE_CHECKING = False  # what type checkers take for true: nothing is imported before `lapwing` answers Ctrl-C
if TYPE_CHECKING:
    from cosim.errors import LockStepError
    from cosim.scene import Scene, SceneError
    from lapwing.api import campaign, fly, load, read
    from lapwing.batch import Batch, BatchState
    from lapwing.flight import Flight
    from lapwing.simulator import Observation, Simulator
    from services.common.ports import Reference
    from studies.campaign.distributions import choice, linspace, loguniform, normal, uniform
    from studies.events import Event
    from studies.verdict import Verdict

_WHERE = {
    "Batch": "lapwing.batch",
    "BatchState": "lapwing.batch",
    "Event": "studies.events",
    "Flight": "lapwing.flight",
    "LockStepError": "cosim.errors",
    "Observation": "lapwing.simulator",
    "Reference": "services.common.ports",
    "Scene": "cosim.scene",
    "SceneError": "cosim.scene",
    "Simulator": "lapwing.simulator",
    "Verdict": "studies.verdict",
    "campaign": "lapwing.api",
    "choice": "studies.campaign.distributions",
    "fly": "lapwing.api",
    "linspace": "studies.campaign.distributions",
    "load": "lapwing.api",
    "loguniform": "studies.campaign.distributions",
    "normal": "studies.campaign.distributions",
    "read": "lapwing.api",
    "uniform": "studies.campaign.distributions",
}

__all__ = [
    "Batch",
    "BatchState",
    "Event",
    "Flight",
    "LockStepError",
    "Observation",
    "Reference",
    "Scene",
    "SceneError",
    "Simulator",
    "Verdict",
    "campaign",
    "choice",
    "fly",
    "linspace",
    "load",
    "loguniform",
    "normal",
    "read",
    "uniform",
]


def __getattr__(name: str) -> object:
    """The public names, imported when they are first asked for: `lapwing --help` needs none of them."""
    import importlib

    if name not in _WHERE:
        raise AttributeError(f"module 'lapwing' has no attribute {name!r}")
    return getattr(importlib.import_module(_WHERE[name]), name)


def __dir__() -> list[str]:
    return __all__
