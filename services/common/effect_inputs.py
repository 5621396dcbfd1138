"""Named inputs of effects, which FMUs compute: `effect.battery.voltage` in the `outputs` of `[services.NAME]`."""

from collections.abc import Mapping

from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics import effects
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._external_inputs import inputs_of
from lapwing.services.common.ports import EFFECT

SERVICES, EFFECTS = "services", "effects"


def with_inputs(scene: Scene) -> list[str]:
    """Return the names of the scene's effects that can have named inputs, in the order of evaluation."""
    tables = scene.tables(EFFECTS)
    modules = {name: table.get("module") for name, table in tables.items()}
    return [
        name
        for name in effects.in_evaluation_order(tables)
        if hasattr(effects.parameter_class(name, modules[name]), "with_inputs")
    ]


def external(scene: Scene) -> list[str]:
    """Return the names of the effects whose named inputs FMUs compute, in the order of evaluation."""
    if not scene.has(SERVICES):
        return []
    outputs = [table.get("outputs") for table in scene.tables(SERVICES).values() if isinstance(table, Mapping)]
    columns = [column for each in outputs if isinstance(each, Mapping) for column in each]
    desired = {column.split(".")[1] for column in columns if column.startswith(EFFECT)}
    return [name for name in with_inputs(scene) if name in desired]


def check(scene: Scene, key: str, column: str) -> None:
    """Raise ConfigError unless the scene has the effect of a column, and it has named inputs.

    Args:
        scene: scene with its tables.
        key: scene key, for the message.
        column: "effect.battery.voltage".
    """
    name = column.split(".")[1]
    names = with_inputs(scene)
    if name in names:
        return
    if name in scene.tables(EFFECTS):
        listed = ", ".join(names) or "none in this scene"
        raise ConfigError(key, f"the effect {name} has no named inputs", f"an effect that has them: {listed}")
    possible = [each for each in effects.names() if hasattr(effects.parameter_class(each), "with_inputs")]
    if name in possible:
        raise ConfigError(key, f"the scene has no effect {name}", f"a table [effects.{name}]")
    raise ConfigError.unknown(key, "effect", name, {*possible, *names})


def ports_of(scene: Scene, active: tuple) -> dict[str, Port]:
    """Return the ports of the named inputs that FMUs compute.

    Args:
        scene: scene with its tables.
        active: effects of the scene, in the order of evaluation.
    """
    names = [EFFECT + name for name in external(scene)]
    return {name: Port(name, example) for name, example in zip(names, inputs_of(active), strict=True)}
