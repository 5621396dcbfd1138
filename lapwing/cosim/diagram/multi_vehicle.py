"""Several vehicles in one run: their set-ups joined to one, and the parts of all of them in one graph.

Vehicle by vehicle a fleet is what the run of that vehicle alone would be. Here the names of its ports, parts and topics
get the vehicle's in front; nobody else knows of fleets but who speaks of a vehicle by its name.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from lapwing.cosim.config.run_config import PerVehicle, RunConfig, ServiceConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service
from lapwing.cosim.diagram.compiled_block import Block, BoundBlock
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.messages.topics import CLOCK, Topic, of_vehicle


def within(vehicle: str, name: str) -> str:
    """Full name of a port or part of `vehicle` in a fleet.

    A name with a leading slash is one of another vehicle and is already full: "/left/truth".
    """
    return name[1:] if name.startswith("/") else f"{vehicle}/{name}"


def of_other(vehicle: str, name: str) -> str:
    """What a vehicle calls the port of another one."""
    return f"/{within(vehicle, name)}"


def joined(members: Sequence[RunConfig], resolved: Mapping[str, Any]) -> RunConfig:
    """The set-up of a fleet.

    Args:
        members: that of each vehicle, as if it flew alone; all with the same scene, seed, ticks and coupling.
        resolved: the tables of the whole scene.
    """
    services = {}
    for name in dict.fromkeys(name for member in members for name in member.services):
        having = [member for member in members if name in member.services]
        shares = tuple(member.services[name] for member in having)
        pairs = [(member.vehicle, share) for member, share in zip(having, shares, strict=True)]
        services[name] = ServiceConfig(
            PerVehicle(tuple(member.vehicle for member in having), shares),
            tuple(_input(vehicle, i) for vehicle, share in pairs for i in share.inputs),
            tuple(_port(vehicle, port) for vehicle, share in pairs for port in share.ports),
        )
    beside = {}
    for name in dict.fromkeys(name for member in members for name in member.beside):
        having = [member for member in members if name in member.beside]
        beside[name] = PerVehicle(tuple(m.vehicle for m in having), tuple(m.beside[name] for m in having))
    return members[0]._replace(vehicle="", services=services, beside=beside, resolved=dict(resolved))


def members(setup: RunConfig) -> tuple[RunConfig, ...]:
    """The set-up of each vehicle of a run, as if it flew alone; of a run of one vehicle that run itself."""
    if setup.vehicle:
        return (setup,)
    common = {name: table for name, table in setup.resolved.items() if name != "vehicle"}
    return tuple(
        setup._replace(
            vehicle=vehicle,
            services=_of(vehicle, {name: service.parameters for name, service in setup.services.items()}),
            beside=_of(vehicle, setup.beside),
            resolved={**common, **entry},
        )
        for vehicle, entry in zip(setup.vehicles, setup.resolved["vehicle"], strict=True)
    )


def member(setup: RunConfig, vehicle: str) -> RunConfig:
    """The set-up of one of the vehicles, as if it flew alone."""
    return members(setup)[setup.vehicles.index(vehicle)]


def _of(vehicle: str, each: Mapping[str, PerVehicle]) -> dict[str, Any]:
    return {
        name: given.given[given.vehicles.index(vehicle)] for name, given in each.items() if vehicle in given.vehicles
    }


def leading(setup: RunConfig, topic: Topic) -> Topic:
    """The topic of the vehicle that stands for all, where there is room for one."""
    return topic if setup.vehicle else of_vehicle(topic, setup.vehicles[0])


def joined_service(name: str, services: Sequence[tuple[RunConfig, Service]]) -> Service:
    """A service of a fleet, of those of its vehicles with the set-up of each."""
    whole = Service(name, [], [])
    parts, wires, spoken = [], [], []
    clocks = 0
    for member, service in services:
        vehicle = member.vehicle
        parts += [_part(member, part) for part in service.parts]
        for wire in service.wires:
            clocks += wire.topic is CLOCK
            if wire.topic is not CLOCK or clocks == 1:  # they would all tell the same time
                topic, port = of_vehicle(wire.topic, vehicle), within(vehicle, wire.port)
                wires.append(replace(wire, topic=topic, port=port))
        service.messages = _Outbox(whole, vehicle)
        spoken += [of_vehicle(topic, vehicle) for topic in service.spoken]
    whole.parts, whole.wires, whole.spoken = parts, wires, spoken
    return whole


class _Outbox(list[tuple[Topic, int, bytes]]):
    """Passes the messages of a vehicle's service on to that of the fleet."""

    def __init__(self, whole: Service, vehicle: str):
        super().__init__()
        self._whole, self._vehicle = whole, vehicle

    def append(self, message: tuple[Topic, int, bytes]) -> None:
        topic, tick, payload = message
        self._whole.messages.append((of_vehicle(topic, self._vehicle), tick, payload))


def _input(vehicle: str, i: InputPort) -> InputPort:
    return i._replace(port=within(vehicle, i.port))


def _port(vehicle: str, port: Port) -> Port:
    return port._replace(name=within(vehicle, port.name))


def _part(member: RunConfig, part: Any) -> Any:
    vehicle = member.vehicle
    if not isinstance(part, Block):
        return VehicleBlock(member, part)
    return replace(
        part,
        name=within(vehicle, part.name),
        inputs=tuple(_input(vehicle, i) for i in part.inputs),
        outputs=tuple(_port(vehicle, port) for port in part.outputs),
        failure=part.failure and partial(_failure, vehicle, part.failure),
        vehicle=vehicle,
    )


def _failure(vehicle: str, of_part: Callable[[int], Exception], tick: int) -> Exception:
    error = of_part(tick)
    return type(error)(f"{vehicle}: {error}")


class VehicleBlock:
    """A part of a vehicle that stays in Python."""

    def __init__(self, member: RunConfig, part: Any):
        """`member`: the set-up of the vehicle."""
        self._member, self._part = member, part
        self.vehicle = member.vehicle
        self.name = within(self.vehicle, part.name)
        self.outputs = tuple(_port(self.vehicle, port) for port in part.outputs)
        self.inputs = tuple(_input(self.vehicle, i) for i in getattr(part, "inputs", ()))

    def bind(self, graph: BlockDiagram) -> None:
        """Get the vehicle's own part of the graph."""
        self._part.bind(VehicleDiagram(graph, self._member))

    def act(self, tick: int) -> int:
        """Do what is to be done at `tick`."""
        return self._part.act(tick)


class VehicleDiagram:
    """What a Python part of a vehicle sees of the graph of its fleet: the ports and parts of that vehicle, by the names
    that they have where it flies alone."""

    def __init__(self, graph: BlockDiagram, member: RunConfig):
        self._graph, self.setup = graph, member

    def part(self, name: str) -> Block:
        """As of `BlockDiagram`."""
        return self._graph.part(within(self.setup.vehicle, name))

    def prepare(self, part: Block) -> BoundBlock:
        """As of `BlockDiagram`."""
        return self._graph.prepare(part)

    def replace(self, part: Block, code: BoundBlock) -> None:
        """As of `BlockDiagram`."""
        self._graph.replace(part, code)

    def has(self, port: str) -> bool:
        """As of `BlockDiagram`."""
        return self._graph.has(within(self.setup.vehicle, port))

    def latest(self, port: str, tick: int) -> Any:
        """As of `BlockDiagram`."""
        return self._graph.latest(within(self.setup.vehicle, port), tick)

    def put(self, port: str, tick: int, value: Any) -> None:
        """As of `BlockDiagram`."""
        self._graph.put(within(self.setup.vehicle, port), tick, value)
