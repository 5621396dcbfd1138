"""Several vehicles in one run: their run configurations merged into one, and their blocks in one diagram.

Each vehicle of a fleet behaves as in a run of that vehicle alone. Here the names of its ports, blocks and topics get
the vehicle's name as a prefix. Other modules handle fleets only where they refer to a vehicle by name.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from lapwing.cosim.config.run_config import PerVehicle, RunConfig, ServiceConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service, is_connected
from lapwing.cosim.diagram.compiled_block import Block, BoundBlock
from lapwing.cosim.diagram.port_rows import RenamedPortRows
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.messages.topics import CLOCK, Topic, of_vehicle


def qualified_name(vehicle: str, name: str) -> str:
    """Return the full name of a port or block of `vehicle` in a fleet.

    A name with a leading slash belongs to another vehicle and is already complete: "/left/truth".
    """
    return name[1:] if name.startswith("/") else f"{vehicle}/{name}"


def neighbour_port(vehicle: str, name: str) -> str:
    """Return the name by which a vehicle refers to the port of another vehicle."""
    return f"/{qualified_name(vehicle, name)}"


def merge_configs(members: Sequence[RunConfig], resolved: Mapping[str, Any]) -> RunConfig:
    """Return the run configuration of a fleet.

    Args:
        members: run configuration of each vehicle alone; all with the same scene, seed, ticks and coupling.
        resolved: tables of the whole scene.
    """
    services = {}
    for name in dict.fromkeys(name for member in members for name in member.services):
        configs = {member.vehicle: member.services[name] for member in members if name in member.services}
        services[name] = ServiceConfig(
            PerVehicle(tuple(configs), tuple(configs.values())),
            tuple(dict.fromkeys(_input(vehicle, i) for vehicle, config in configs.items() for i in config.inputs)),
            tuple(_port(vehicle, port) for vehicle, config in configs.items() for port in config.ports),
        )
    auxiliary = {}
    for name in dict.fromkeys(name for member in members for name in member.auxiliary):
        values = {member.vehicle: member.auxiliary[name] for member in members if name in member.auxiliary}
        auxiliary[name] = PerVehicle(tuple(values), tuple(values.values()))
    return members[0]._replace(vehicle="", services=services, auxiliary=auxiliary, resolved=dict(resolved))


def members(config: RunConfig) -> tuple[RunConfig, ...]:
    """Return the run configuration of each vehicle alone; for a single vehicle, that of the run."""
    if config.vehicle:
        return (config,)
    common = {name: table for name, table in config.resolved.items() if name != "vehicle"}
    return tuple(
        config._replace(
            vehicle=vehicle,
            services=_values_of(vehicle, {name: service.parameters for name, service in config.services.items()}),
            auxiliary=_values_of(vehicle, config.auxiliary),
            resolved={**common, **entry},
        )
        for vehicle, entry in zip(config.vehicles, config.resolved["vehicle"], strict=True)
    )


def member(config: RunConfig, vehicle: str) -> RunConfig:
    """Return the run configuration of one vehicle alone."""
    return members(config)[config.vehicles.index(vehicle)]


def _values_of(vehicle: str, services: Mapping[str, PerVehicle]) -> dict[str, Any]:
    return {
        name: values.given[values.vehicles.index(vehicle)]
        for name, values in services.items()
        if vehicle in values.vehicles
    }


def primary_topic(config: RunConfig, topic: Topic) -> Topic:
    """Return the topic of the first vehicle, for displays with room for one vehicle."""
    return topic if config.vehicle else of_vehicle(topic, config.vehicles[0])


def merge_services(name: str, services: Sequence[tuple[RunConfig, Service]]) -> Service:
    """Return a service with the blocks of all vehicles; `services` has the configuration and service of each."""
    fleet = Service(name, [], [])
    blocks, encoders, python_topics = [], [], []
    clocks = 0
    for member, service in services:
        vehicle = member.vehicle
        blocks += [_block(member, block) for block in service.blocks]
        for encoder in service.encoders:
            clocks += encoder.topic is CLOCK
            if encoder.topic is not CLOCK or clocks == 1:  # the clocks of all vehicles are equal
                topic, port = of_vehicle(encoder.topic, vehicle), qualified_name(vehicle, encoder.port)
                encoders.append(replace(encoder, topic=topic, port=port))
        service.messages = _Outbox(fleet, vehicle)
        python_topics += [of_vehicle(topic, vehicle) for topic in service.python_topics]
    fleet.blocks, fleet.encoders, fleet.python_topics = blocks, encoders, python_topics
    return fleet


class _Outbox(list[tuple[Topic, int, bytes]]):
    """Adds the messages of a vehicle's service to those of the fleet's service."""

    def __init__(self, fleet: Service, vehicle: str):
        super().__init__()
        self._fleet, self._vehicle = fleet, vehicle

    def append(self, message: tuple[Topic, int, bytes]) -> None:
        topic, tick, payload = message
        self._fleet.messages.append((of_vehicle(topic, self._vehicle), tick, payload))


def _input(vehicle: str, i: InputPort) -> InputPort:
    return i._replace(port=qualified_name(vehicle, i.port))


def _port(vehicle: str, port: Port) -> Port:
    return port._replace(name=qualified_name(vehicle, port.name))


def _block(member: RunConfig, block: Any) -> Any:
    vehicle = member.vehicle
    if not isinstance(block, Block):
        return (ConnectedVehicleBlock if is_connected(block) else VehicleBlock)(member, block)
    return replace(
        block,
        name=qualified_name(vehicle, block.name),
        inputs=tuple(_input(vehicle, i) for i in block.inputs),
        outputs=tuple(_port(vehicle, port) for port in block.outputs),
        failure=block.failure and partial(_failure, vehicle, block.failure),
        vehicle=vehicle,
    )


def _failure(vehicle: str, failure: Callable[[int], Exception], tick: int) -> Exception:
    error = failure(tick)
    return type(error)(f"{vehicle}: {error}")


class VehicleBlock:
    """Python block of a vehicle in a fleet."""

    def __init__(self, member: RunConfig, block: Any):
        """Wrap a Python block of the vehicle with the run configuration `member`."""
        self._member, self._block = member, block
        self.vehicle = member.vehicle
        self.name = qualified_name(self.vehicle, block.name)
        self.outputs = tuple(_port(self.vehicle, port) for port in block.outputs)
        self.inputs = tuple(_input(self.vehicle, i) for i in getattr(block, "inputs", ()))

    def bind(self, diagram: BlockDiagram) -> None:
        """Bind the block to the vehicle's view of the diagram."""
        self._block.bind(VehicleDiagram(diagram, self._member))

    def on_tick(self, tick: int) -> int:
        """Run the block at `tick`."""
        return self._block.on_tick(tick)

    def failure(self, tick: int) -> Exception:
        """Return the error of the block's compiled code at `tick`."""
        return _failure(self.vehicle, self._block.failure, tick)


class ConnectedVehicleBlock(VehicleBlock):
    """Python block of a vehicle with a connection to a program outside the run."""

    def open(self, report_wait: Callable[[str], None], log: Path | None = None) -> None:
        """Connect; files of the program have the name of the vehicle."""
        self._block.open(report_wait, log and log.with_suffix(f".{self.vehicle}.mcap"))

    def close(self) -> None:
        """End the connection."""
        self._block.close()

    @property
    def reports(self) -> dict[str, str]:
        """Entries of the log's metadata, by vehicle."""
        return {f"{self.vehicle}/{key}": text for key, text in self._block.reports.items()}


class VehicleDiagram(RenamedPortRows):
    """View of a fleet's block diagram for one vehicle, with the names of a run of that vehicle alone."""

    def __init__(self, diagram: BlockDiagram, member: RunConfig):
        super().__init__(diagram, partial(qualified_name, member.vehicle))
        self._diagram, self.config = diagram, member

    def block(self, name: str) -> Block:
        """Return the compiled block of this name."""
        return self._diagram.block(qualified_name(self.config.vehicle, name))

    def prepare(self, block: Block) -> BoundBlock:
        """Compile or load a block that replaces another one later."""
        return self._diagram.prepare(block)

    def replace(self, block: Block, code: BoundBlock) -> None:
        """Replace the block of the same name by a prepared one."""
        self._diagram.replace(block, code)
