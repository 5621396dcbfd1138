"""Plant service: the clock owner, which integrates the model of the scene's `vehicle.model`."""

from dataclasses import replace
from typing import Any

from numba import types

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import NEVER, BlockDiagram, Service
from lapwing.cosim.diagram.compiled_block import Block, BoundBlock
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.run_errors import DivergedError
from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._vehicle_interaction import NeighbourState
from lapwing.dynamics.integrators import not_finite
from lapwing.dynamics.multibody.five_bodies import FiveBodies
from lapwing.dynamics.vehicles import multirotor_euler, multirotor_multibody
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorDrive, MultirotorParameters, MultirotorState
from lapwing.dynamics.vehicles.multirotor_multibody_equations import apply_constraint_impulse
from lapwing.kernels import kernel
from lapwing.kernels.cell import Cell, read, write
from lapwing.kernels.codegen import generic
from lapwing.services.common import ports
from lapwing.services.common.ports import PerRotor
from lapwing.services.plant.blocks import system_outputs  # noqa: F401 (registers output functions)
from lapwing.services.plant.blocks.interaction import Interaction
from lapwing.services.plant.blocks.multirotor import MultirotorPlantState
from lapwing.services.plant.blocks.neighbour_state import PresenceView
from lapwing.services.plant.encoders import wires
from lapwing.services.plant.fleet_coupling import LOAD, PRESENCE
from lapwing.services.plant.service_config import FleetCoupling, PlantEvent, PlantSetup

NAME = "plant"


def create(setup: RunConfig) -> Service:
    """Return the plant of a run."""
    config = setup.services[NAME]
    plant: PlantSetup = config.parameters
    state = Cell(plant.start)
    bodies = [port for port in config.ports if port.name == ports.BODIES]
    feet = tuple(port for port in config.ports if port.name == ports.CONTACT)
    truth_ports = tuple(port for port in config.ports if port not in bodies and port not in feet)
    has_own_bodies = plant.model == "cooperative_load"  # the motion of the bodies comes with the plant's step
    part = Block(
        NAME,
        plant.core,
        state,
        config.inputs,
        config.ports if has_own_bodies else truth_ports,
        failure=_diverged(setup, plant, state),
    )
    parts: list[Any] = [part]
    if plant.events:
        parts.insert(0, PropellerFailures(plant, part))
    if plant.others:
        parts = _among_others(plant, plant.others, parts, state, bodies)
    if bodies and plant.bodies and not has_own_bodies:
        inputs = config.inputs[:1]
        parts.append(Block(f"{NAME}.bodies", plant.bodies, state, inputs, tuple(bodies), bodies[0].period))
    if plant.contact:
        parts.append(Block(f"{NAME}.contact", plant.contact, state, (InputPort(ports.TRUTH),), feet, feet[0].period))
    return Service(NAME, parts, wires(setup, plant.wiring))


def _among_others(
    plant: PlantSetup, others: FleetCoupling, parts: list[Any], state: Cell, bodies: list[Port]
) -> list[Any]:
    """Return the plant's blocks between the effects of its neighbours and its own neighbour state."""
    vehicle, interval = plant.core.vehicle, plant.core.interval
    interaction = Interaction(vehicle.effects, interval)
    view = PresenceView(vehicle, others.presence, interval)
    result = [
        Block(f"{NAME}.interaction", interaction, state, _a_tick_ago(PRESENCE, *others.ports)),
        *parts,
        Block(f"{NAME}.{PRESENCE}", view, state, (InputPort(ports.TRUTH),), (Port(PRESENCE, others.presence),)),
    ]
    if others.load:
        load_ports = (Port(LOAD, NeighbourState()), *bodies)
        carriers = _a_tick_ago(*others.load_inputs)
        result.append(Block(f"{NAME}.{LOAD}", others.load, Cell(others.load_start), carriers, load_ports))
    return result


def _a_tick_ago(*names: str) -> tuple[InputPort, ...]:
    return tuple(InputPort(name, 1) for name in names)


def _diverged(setup: RunConfig, plant: PlantSetup, state: Cell) -> Any:
    def error(tick: int) -> DivergedError:
        x, t = read(state), tick * setup.interval
        if plant.euler and (body := multirotor_euler.singular(x.vehicle.motion)) >= 0:
            return DivergedError(
                f"the multirotor: {plant.wiring.bodies[body]}: pitch reached 90 degrees by t = {t:g} s, where "
                'Euler angles end; multibody.coordinates = "se3" has no such place'
            )
        system = "the multirotor" if isinstance(x, MultirotorPlantState) else plant.model
        motion = x.vehicle.motion if isinstance(x, MultirotorPlantState) else x
        where = f"{system}: not finite at t = {t:g} s: {not_finite(motion)}"
        return DivergedError(f"{where}; take a smaller step than {plant.core.step:g} s")

    return error


class PropellerFailures:
    """Propellers that are locked, released or torn off in flight: another plant then continues with the state."""

    name = f"{NAME}.breakages"
    outputs = ()

    def __init__(self, plant: PlantSetup, part: Block):
        self._events, self._form = list(plant.events), multirotor_euler if plant.euler else multirotor_multibody
        self._part, self._core = part, plant.core
        self._bodies = plant.bodies
        self._failed_plants: list[
            tuple[Any, list[tuple[Block, BoundBlock]]]
        ] = []  # vehicle and prepared blocks of each event

    def bind(self, graph: BlockDiagram) -> None:
        """Compile the plants of all failures before the first tick."""
        self._graph = graph
        p, s = self._core.vehicle, read(self._part.state)
        for event in self._events:
            p = self._form.with_propeller_failure(p, event.propeller, event.becomes)
            if event.becomes == "locked":
                lock(p, s.vehicle, self._core.off)
            parts = [
                replace(graph.part(name), parameters=parameters._replace(vehicle=p))
                for name, parameters in ((NAME, self._core), (f"{NAME}.bodies", self._bodies))
            ]
            self._failed_plants.append((p, [(part, graph.prepare(part)) for part in parts]))

    def on_tick(self, tick: int) -> int:
        """Apply the failures of `tick` after its state has been output."""
        while self._events and self._events[0].tick < tick:
            self._break(tick, self._events.pop(0), *self._failed_plants.pop(0))
        return self._events[0].tick + 1 if self._events else NEVER

    def _break(self, tick: int, event: PlantEvent, p: Any, parts: list[tuple[Block, BoundBlock]]) -> None:
        if event.becomes == "locked":
            stamp = tick - self._part.inputs[0].delay
            command = self._core.off if stamp < 0 else self._graph.latest(ports.ACTUATORS, stamp).motor_voltage
            s = read(self._part.state)
            write(self._part.state, s._replace(vehicle=lock(p, s.vehicle, command)))
        for part, code in parts:
            self._graph.replace(part, code)


@kernel
def lock(p: MultirotorParameters, s: MultirotorState, command: PerRotor) -> MultirotorState:
    """Return the state s after an impulse that satisfies the constraints of p, under a command [V]."""
    memory = s.memory
    drive = MultirotorDrive(p, hooks.all_mass_properties(p.effects, memory, p.body), memory, command)
    return MultirotorState(_after_impulses(drive, s.motion), memory)


@generic()
def _after_impulses(drive: types.Type, x: types.Type) -> Any:
    """Return the bodies after impulses in their hinges, in any coordinates."""
    return apply_constraint_impulse if x.instance_class is FiveBodies else multirotor_euler.apply_constraint_impulse
