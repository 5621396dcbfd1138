"""Resolution of a scene's `[services.NAME]` tables into the configuration of the FMUs."""

from collections.abc import Mapping

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.tick_schedule import LATCHED, InputPort, Port, execution_order
from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common import effect_inputs
from lapwing.services.common.ports import EFFECT
from lapwing.services.common.vehicle_schema import active
from lapwing.services.fmu.model import ImportedFmu
from lapwing.services.fmu.schema import Services
from lapwing.services.fmu.service_config import FmuConfig, FmuSetup, own_port, replaced_port

NAME = "fmu"


def connect(scene: Scene, services: Mapping[str, ServiceConfig]) -> dict[str, ServiceConfig]:
    """Return the services of a scene with its FMUs between them.

    An FMU publishes a copy of each port of which it computes columns. All other services read the copy. Outputs that
    other FMUs read are a port of its own.

    Raises:
        ConfigError: an FMU or a connection is invalid, or the connections are a loop without delay.
    """
    if not scene.has(Services):
        return dict(services)
    table = scene[Services]
    known = {port.name: port for service in services.values() for port in service.ports}
    imported = {name: ImportedFmu(name, table.fmu(name)) for name in table.tables}
    effects = _effect_ports(scene, services)
    configs = [fmu.config(known, imported, effects) for fmu in imported.values()]
    fmus = tuple(_ordered([imported[each.name].with_exports(each) for each in configs]))
    inputs: dict[tuple[str, int], None] = {}
    ports: dict[str, Port] = {}
    for fmu in fmus:
        key = f"services.{fmu.name}.outputs"
        own = own_port(fmu.name)
        if not fmu.outputs:
            raise ConfigError(key, "nothing reads an output of the FMU", 'a table of "PORT.COLUMN" = "VARIABLE"')
        for port in dict.fromkeys(each.port for each in fmu.outputs):
            if port == own:
                ports[port] = Port(own, (0.0,) * len(imported[fmu.name].exported))
                continue
            if port in ports or any(replaced_port(other.name, port) in ports for other in fmus):
                raise ConfigError(key, f"two FMUs compute columns of {port}", "one FMU for each port")
            if port in effects:
                ports[port] = effects[port]
                continue
            if known[port].period == LATCHED:
                raise ConfigError(key, f"{port} changes at events only", "a port that is published periodically")
            ports[replaced_port(fmu.name, port)] = known[port]._replace(name=replaced_port(fmu.name, port))
            inputs[port, 0] = None
        for each in fmu.inputs:
            if each.port in known:
                inputs[each.port, fmu.delay] = None
    setup = FmuSetup(fmus)
    result = {name: with_replaced_inputs(service, setup) for name, service in services.items()}
    result[NAME] = ServiceConfig(setup, tuple(InputPort(*each) for each in inputs), tuple(ports.values()))
    _check_loops(result, fmus)
    return result


def _effect_ports(scene: Scene, services: Mapping[str, ServiceConfig]) -> dict[str, Port]:
    """Return the ports of named inputs of effects that FMUs compute. Raise ConfigError if the scene has none such."""
    for name, table in scene[Services].tables.items():
        for column in table.get("outputs", {}):
            if column.startswith(EFFECT):
                effect_inputs.check(scene, f'services.{name}.outputs."{column}"', column)
    read = {i.port for service in services.values() for i in service.inputs if i.port.startswith(EFFECT)}
    return effect_inputs.ports_of(scene, active(scene)) if read else {}


def _ordered(fmus: list[FmuConfig]) -> list[FmuConfig]:
    """Return FMUs so that each follows those whose outputs it reads without delay."""
    by_name = {fmu.name: fmu for fmu in fmus}
    own = {own_port(name): name for name in by_name}
    needs = {fmu.name: [InputPort(i.port, fmu.delay) for i in fmu.inputs if i.port in own] for fmu in fmus}
    try:
        order = execution_order(needs, {name: [port] for port, name in own.items()})
    except LockStepError as error:
        names = str(error).rpartition(": ")[2]
        first = names.partition(",")[0]
        message = f"an algebraic loop of the FMUs {names}"
        raise ConfigError(f"services.{first}.delay", message, "delay = 1 for one of them") from None
    return [by_name[name] for name in order]


def _check_loops(services: Mapping[str, ServiceConfig], fmus: tuple[FmuConfig, ...]) -> None:
    try:
        execution_order(
            {name: service.inputs for name, service in services.items()},
            {name: [port.name for port in service.ports] for name, service in services.items()},
        )
    except LockStepError as error:
        names = str(error).rpartition(": ")[2]
        keys = ", ".join(f"services.{fmu.name}" for fmu in fmus if not fmu.delay)
        message = f"an algebraic loop, a loop without delay, through {names}"
        raise ConfigError(keys, message, "delay = 1 for the FMU that closes it") from None


def with_replaced_inputs(service: ServiceConfig, setup: FmuSetup) -> ServiceConfig:
    """Return a service that reads the ports of FMUs in place of the ones that they replace."""
    replaced = setup.replaced
    return service._replace(inputs=tuple(i._replace(port=replaced.get(i.port, i.port)) for i in service.inputs))
