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
from lapwing.services.common.firmware.exchange_block import ExchangeBlock
from lapwing.services.common.firmware.hold import COMMAND, HeldState, Hold
from lapwing.services.common.firmware.hold_reference import HoldReference
from lapwing.services.common.firmware.link import Link
from lapwing.services.common.firmware.playback import TOPICS, Playback, Recorded
from lapwing.services.common.firmware.setup import FirmwareSetup


def firmware_service(
    setup: RunConfig, name: str, create: Callable[[FirmwareSetup], Link], recorded: Recorded | None = None
) -> Service:
    """Return the service of an adapter.

    Args:
        setup: run configuration of one vehicle.
        name: name of the service.
        create: class of the link.
        recorded: messages of a log to resimulate; None: run the firmware.
    """
    config = setup.services[name]
    own: FirmwareSetup = config.parameters
    if recorded is not None:
        service = Service(name, [], [])
        service.parts = [Playback(name, config.ports, recorded, service)]
        service.python_topics = TOPICS if own.phases else TOPICS[:2]
        return service
    kind = ExchangeBlock if hasattr(create, "exchange") else FirmwareBlock
    link = kind(name, own, config.inputs, create)
    zeros = (0.0,) * len(own.order)
    parameters: Any = Hold(own.voltage_max, zeros)
    inputs = [InputPort(COMMAND), InputPort(ports.BATTERY)]
    if own.phases:
        parameters = HoldReference(parameters)
        inputs.append(InputPort(ports.TRAJECTORY))
    hold = Block(f"{name}.hold", parameters, Cell(HeldState(own.voltage_max)), tuple(inputs), config.ports)
    phases = own.phases or ("",)
    encoders = [
        actuators_encoder(setup.port(ports.ACTUATORS)),
        status_encoder(own.status_every, phases, link.status_texts.table),
        *([setpoint_encoder(topic.SETPOINT, ports.SETPOINT, phases)] if own.phases else []),
    ]
    return Service(name, [link, hold], encoders)
