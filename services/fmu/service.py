"""Service of the lock step that steps an FMU in a process of its own."""

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.services.common import foreign_code
from lapwing.services.common.encoders import reading_encoder
from lapwing.services.fmu.block import FmuBlock
from lapwing.services.fmu.service_config import FmuConfig, replaced_port


def create(setup: RunConfig, name: str) -> Service:
    """Return the service of an FMU.

    Args:
        setup: run configuration.
        name: name of the service, such as "motor_fmu" for `[services.motor]`.

    Raises:
        ValueError: foreign code is not allowed (`--allow-code`).
    """
    foreign_code.check(setup)
    fmu: FmuConfig = setup.services[name].parameters
    own = {port.name: port for port in setup.services[name].ports}
    ports = dict.fromkeys(each.port for each in fmu.outputs)
    block = FmuBlock(fmu, {port: own.get(port) or own[replaced_port(fmu.name, port)] for port in ports})
    return Service(name, [block], [reading_encoder(setup.vehicle, port) for port in own.values()])
