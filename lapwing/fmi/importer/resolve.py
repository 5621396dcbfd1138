"""Resolution of a scene's `[services.NAME]` tables into the configuration of the FMUs."""

from collections.abc import Mapping

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.tick_schedule import LATCHED, InputPort, Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.fmi.importer.model import ImportedFmu
from lapwing.fmi.importer.schema import Services
from lapwing.fmi.importer.service_config import FmuConfig, is_new, own_port, replaced_port, replaced_ports
from lapwing.services.common import effect_inputs
from lapwing.services.common.foreign_code import FMU_SUFFIX
from lapwing.services.common.ports import EFFECT
from lapwing.services.common.schemas.vehicle_schema import active


def connect(scene: Scene, services: Mapping[str, ServiceConfig]) -> dict[str, ServiceConfig]:
    """Return the services of a scene with a service for each of its FMUs.

    An FMU publishes a copy of each port of which it computes columns. All services but FMUs read the copy. Outputs that
    other FMUs read form a separate port.

    Raises:
        ConfigError: an FMU or a connection is invalid, or the connections form an algebraic loop.
    """
    if not scene.has(Services):
        return dict(services)
    table = scene[Services]
    published = {port.name: port for service in services.values() for port in service.ports}
    imported = {name: ImportedFmu(name, table.fmu(name)) for name in table.tables}
    effects = _effect_ports(scene, services)
    configs = [fmu.config(published, imported, effects) for fmu in imported.values()]
    fmus = [imported[each.name].with_exports(each) for each in configs]
    _check_outputs(fmus, published)
    replaced = replaced_ports(fmus)
    result = {
        name: service._replace(inputs=tuple(i._replace(port=replaced.get(i.port, i.port)) for i in service.inputs))
        for name, service in services.items()
    }
    for fmu in fmus:
        exported = len(imported[fmu.name].exported)
        result[fmu.name + FMU_SUFFIX] = _service(fmu, exported, {**published, **effects})
    _check_loops(result, fmus)
    return result


def _check_outputs(fmus: list[FmuConfig], published: Mapping[str, Port]) -> None:
    """Raise ConfigError unless each FMU computes a column, and each port has columns of at most one FMU."""
    owners: dict[str, str] = {}
    for fmu in fmus:
        key = f"services.{fmu.name}.outputs"
        if not fmu.outputs:
            raise ConfigError(key, "no service reads an output of the FMU", 'a table of "PORT.COLUMN" = "VARIABLE"')
        for port in dict.fromkeys(each.port for each in fmu.outputs):
            if owners.setdefault(port, fmu.name) != fmu.name:
                raise ConfigError(key, f"two FMUs compute columns of {port}", "one FMU for each port")
            if port in published and published[port].period == LATCHED:
                raise ConfigError(key, f"{port} changes at events only", "a port that is published periodically")


def _service(fmu: FmuConfig, exported: int, ports: Mapping[str, Port]) -> ServiceConfig:
    """Return the service of an FMU.

    Args:
        fmu: configuration of the FMU.
        exported: number of outputs that other FMUs read.
        ports: ports of the other services and of the named inputs of effects.
    """
    inputs = {(each.port, fmu.delay): None for each in fmu.inputs}
    outputs = []
    for port in dict.fromkeys(each.port for each in fmu.outputs):
        if port == own_port(fmu.name):
            outputs.append(Port(port, (0.0,) * exported))
        elif is_new(port):
            outputs.append(ports[port])
        else:
            outputs.append(ports[port]._replace(name=replaced_port(fmu.name, port)))
            inputs[port, 0] = None
    return ServiceConfig(fmu, tuple(InputPort(*each) for each in inputs), tuple(outputs))


def _effect_ports(scene: Scene, services: Mapping[str, ServiceConfig]) -> dict[str, Port]:
    """Return the ports of named inputs of effects that FMUs compute.

    Raises:
        ConfigError: the scene has no such input.
    """
    for name, table in scene[Services].tables.items():
        for column in table.get("outputs", {}):
            if column.startswith(EFFECT):
                effect_inputs.check(scene, f'services.{name}.outputs."{column}"', column)
    read = {i.port for service in services.values() for i in service.inputs if i.port.startswith(EFFECT)}
    return effect_inputs.ports_of(scene, active(scene)) if read else {}


def _check_loops(services: Mapping[str, ServiceConfig], fmus: list[FmuConfig]) -> None:
    """Raise ConfigError if undelayed inputs of services form a loop."""
    producers = {port.name: name for name, service in services.items() for port in service.ports}
    sources = {
        name: {producers[i.port] for i in service.inputs if i.delay == 0 and i.port in producers} - {name}
        for name, service in services.items()
    }
    loop: set[str] = set()
    rest = set(services)
    while rest != loop:  # remove services outside of loops
        loop = rest
        rest = {name for name in loop if sources[name] & loop and any(name in sources[other] for other in loop)}
    if not loop:
        return
    keys = ", ".join(f"services.{fmu.name}.delay" for fmu in fmus if fmu.name + FMU_SUFFIX in loop)
    message = f"an algebraic loop through {', '.join(sorted(loop))}"
    raise ConfigError(keys, message, "delay = 1 for the FMU that closes it")
