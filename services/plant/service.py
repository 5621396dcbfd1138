"""Plant service: the clock owner, which integrates the model of the scene's `vehicle.model`."""

from dataclasses import replace
from itertools import groupby
from typing import Any

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import NEVER, BlockDiagram, Service
from lapwing.cosim.diagram.compiled_block import Block, BoundBlock
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.run_errors import DivergedError
from lapwing.dynamics.effects._vehicle_interaction import NeighbourState
from lapwing.dynamics.integrators import not_finite
from lapwing.dynamics.vehicles import multirotor_euler, multirotor_multibody
from lapwing.dynamics.vehicles.propeller_failures import Failure
from lapwing.kernels.cell import Cell, read
from lapwing.services.common import ports
from lapwing.services.plant.blocks import uncontrolled  # noqa: F401 (registers output functions)
from lapwing.services.plant.blocks.failing_multirotor import FailingMultirotorPlant
from lapwing.services.plant.blocks.interaction import Interaction
from lapwing.services.plant.blocks.multirotor import MultirotorPlantState
from lapwing.services.plant.blocks.neighbour_state import NeighbourStateOutput
from lapwing.services.plant.encoders import topic_encoders
from lapwing.services.plant.fleet_coupling import LOAD, PRESENCE
from lapwing.services.plant.service_config import FleetCoupling, PlantConfig

NAME = "plant"


def create(config: RunConfig) -> Service:
    """Return the plant of a run."""
    settings = config.services[NAME]
    plant: PlantConfig = settings.parameters
    state = Cell(plant.start)
    bodies = [port for port in settings.ports if port.name == ports.BODIES]
    feet = tuple(port for port in settings.ports if port.name == ports.CONTACT)
    truth_ports = tuple(port for port in settings.ports if port not in bodies and port not in feet)
    has_own_bodies = plant.model == "cooperative_load"  # the plant's block outputs the bodies
    block = Block(
        NAME,
        plant.core,
        state,
        settings.inputs,
        settings.ports if has_own_bodies else truth_ports,
        failure=_divergence_error(config, plant, state),
    )
    blocks: list[Any] = [block]
    if plant.events:
        blocks.insert(0, PropellerFailures(plant))
    if plant.others:
        blocks = _with_neighbours(plant, plant.others, blocks, state, bodies)
    if bodies and plant.bodies and not has_own_bodies:
        inputs = settings.inputs[:1]
        blocks.append(Block(f"{NAME}.bodies", plant.bodies, state, inputs, tuple(bodies), bodies[0].period))
    if plant.contact:
        blocks.append(Block(f"{NAME}.contact", plant.contact, state, (InputPort(ports.TRUTH),), feet, feet[0].period))
    return Service(NAME, blocks, topic_encoders(config, plant.encoding))


def _with_neighbours(
    plant: PlantConfig, others: FleetCoupling, blocks: list[Any], state: Cell, bodies: list[Port]
) -> list[Any]:
    """Return the plant's blocks between the effects of its neighbours and its own neighbour state."""
    vehicle, interval = plant.core.vehicle, plant.core.interval
    interaction = Interaction(vehicle.effects, interval)
    view = NeighbourStateOutput(vehicle, others.presence, interval)
    result = [
        Block(f"{NAME}.interaction", interaction, state, _delayed_inputs(PRESENCE, *others.ports)),
        *blocks,
        Block(f"{NAME}.{PRESENCE}", view, state, (InputPort(ports.TRUTH),), (Port(PRESENCE, others.presence),)),
    ]
    if others.load:
        load_ports = (Port(LOAD, NeighbourState()), *bodies)
        carriers = _delayed_inputs(*others.load_inputs)
        result.append(Block(f"{NAME}.{LOAD}", others.load, Cell(others.load_start), carriers, load_ports))
    return result


def _delayed_inputs(*names: str) -> tuple[InputPort, ...]:
    return tuple(InputPort(name, 1) for name in names)


def _divergence_error(config: RunConfig, plant: PlantConfig, state: Cell) -> Any:
    def error(tick: int) -> DivergedError:
        x, t = read(state), tick * config.interval
        if plant.euler and (body := multirotor_euler.singular(x.vehicle.motion)) >= 0:
            return DivergedError(
                f"the multirotor: {plant.encoding.bodies[body]}: pitch reached 90 degrees by t = {t:g} s, where "
                'Euler angles are singular; use multibody.coordinates = "se3"'
            )
        system = "the multirotor" if isinstance(x, MultirotorPlantState) else plant.model
        motion = x.vehicle.motion if isinstance(x, MultirotorPlantState) else x
        where = f"{system}: not finite at t = {t:g} s: {not_finite(motion)}"
        return DivergedError(f"{where}; use a smaller step than {plant.core.step:g} s")

    return error


class PropellerFailures:
    """Python block that replaces the plant when a propeller is locked, freed or torn off; the state continues.

    Attributes:
        events: first ticks whose outputs a failure affects.
        replacements: blocks to replace at later ticks, by tick.
    """

    name = f"{NAME}.failures"
    outputs = ()

    def __init__(self, plant: PlantConfig):
        self._steps = {tick: tuple(events) for tick, events in groupby(plant.events, lambda event: event.tick)}
        self._formulation = multirotor_euler if plant.euler else multirotor_multibody
        self._core, self._bodies = plant.core, plant.bodies
        self.events = [tick + 1 for tick in self._steps]
        self.replacements: dict[int, list[tuple[Block, BoundBlock]]] = {}

    def bind(self, diagram: BlockDiagram) -> None:
        """Compile the plants of all failures before the first tick."""
        self._diagram, core = diagram, self._core
        for tick, events in self._steps.items():
            failures, p = [], core.vehicle
            for event in events:
                p = self._formulation.with_propeller_failure(p, event.propeller, event.becomes)
                failures.append(Failure(event.time, p, event.becomes == "locked"))
            failing, core = FailingMultirotorPlant(core, tuple(failures)), core._replace(vehicle=p)
            view = self._bodies._replace(vehicle=p)
            self.replacements[tick + 2] = [self._prepare(NAME, core)]
            self.replacements[tick + 1] = [self._prepare(NAME, failing), self._prepare(f"{NAME}.bodies", view)]

    def _prepare(self, name: str, parameters: Any) -> tuple[Block, BoundBlock]:
        block = replace(self._diagram.block(name), parameters=parameters)
        return block, self._diagram.prepare(block)

    def on_tick(self, tick: int) -> int:
        """Replace the plant of the step to `tick` by one with failures, and that of the step after it by one without.

        The plant of a step starts from the state that has been output.
        """
        for block, code in self.replacements.pop(tick, []):
            self._diagram.replace(block, code)
        return min(self.replacements, default=NEVER)
