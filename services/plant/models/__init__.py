"""Plant models: one file per value of `vehicle.model`, discovered in this folder.

A model file has `check(scene)`, which raises ConfigError for an unsuitable scene, and `resolve(scene)`, which returns
the service's configuration. A scene table of the model is a `SceneTable` in the same file. If the plant is a
system of `lapwing.dynamics.integrators.RATES`, `system(scene)` returns its parameters and initial state.
"""

from types import ModuleType

from lapwing.cosim.scene import Scene
from lapwing.dynamics import discovery
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common.schemas.vehicle_schema import Vehicle


def names() -> list[str]:
    """Return the names of all models: their file names."""
    return discovery.names(__name__)


def get(name: str) -> ModuleType:
    """Return the module of a model. Raise ConfigError with the choices if it does not exist."""
    if name not in names():
        raise ConfigError.unknown("vehicle.model", "model", name, names())
    return discovery.get(__name__, name, "model")


def check(scene: Scene) -> None:
    """Raise ConfigError if the model does not exist, or the scene's tables do not fit it."""
    get(scene[Vehicle].model).check(scene)
