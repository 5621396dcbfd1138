"""Service of a firmware adapter: link, hold and encoders, or the playback of a log."""

from collections.abc import Callable
from typing import Any

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import InputPort
from lapwing.kernels.cell import Cell
from lapwing.messages import topics as topic
from lapwing.services.common import ports
from lapwing.services.common.encoders import actuators_encoder, setpoint_encoder, status_encoder
from lapwing.services.common.firmware.block import FirmwareBlock
from lapwing.services.common.firmware.firmware_config import FirmwareConfig
from lapwing.services.common.firmware.hold import COMMAND, HeldState, Hold
from lapwing.services.common.firmware.playback import TOPICS, Playback, Recorded


def firmware_service(
    config: RunConfig, recorded: Recorded | None = None, *, name: str, link: Callable[[FirmwareConfig], Any]
) -> Service:
    """Return the service of an adapter.

    Args:
        config: run configuration of one vehicle.
        recorded: messages of a log by topic and tick, which replace the firmware; None: run the firmware.
        name: name of the service.
        link: class of the link.
    """
    settings = config.services[name]
    own: FirmwareConfig = settings.parameters
    if recorded is not None:
        service = Service(name, [], [], python_topics=TOPICS if own.phases else TOPICS[:2])
        service.blocks = [Playback(name, settings.ports, recorded, service)]
        return service
    exchange = FirmwareBlock(name, own, settings.inputs, link)
    inputs = tuple(InputPort(port) for port in (COMMAND, ports.BATTERY, *([ports.TRAJECTORY] if own.phases else [])))
    parameters = Hold(own.voltage_max, (0.0,) * len(own.order))
    hold = Block(f"{name}.hold", parameters, Cell(HeldState(own.voltage_max)), inputs, settings.ports)
    phases = own.phases or ("",)
    encoders = [
        actuators_encoder(config.port(ports.ACTUATORS)),
        status_encoder(own.status_every, phases, exchange.status_texts.table),
        *([setpoint_encoder(topic.SETPOINT, ports.SETPOINT, phases)] if own.phases else []),
    ]
    return Service(name, [exchange, hold], encoders)
