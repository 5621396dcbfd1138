"""Quadrotors that carry a point mass by rigid links: thrusts and moments in, states of all bodies out."""

from typing import Any, NamedTuple

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.compiled_block import InputSample
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.integrators import integrate_fixed
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.lie.ts2 import Swing
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_index
from lapwing.kernels.state_tree import finite
from lapwing.papers.cooperative_load.cooperative_load import (
    CooperativeLoadParameters,
    CooperativeLoadState,
    LiftCommand,
    quad_position,
    quad_velocity,
)
from lapwing.services.common.ports import LIFT, TRUTH, BodyMotions, RotorWrenches, TrueState
from lapwing.services.common.schemas.communication_schema import Communication, Rates
from lapwing.services.common.schemas.run_schema import CooperativeLoad
from lapwing.services.plant.blocks.termination import termination_status
from lapwing.services.plant.blocks.uncontrolled import motion_alone
from lapwing.services.plant.models._common import (
    bodies_port,
    check_system,
    last_tick,
    message_contents,
    reject_other_tables,
    require_tables,
)
from lapwing.services.plant.schema import method
from lapwing.services.plant.service_config import PlantConfig


class CooperativePlant(NamedTuple):
    """Parameters of the block: the formation and its integration."""

    formation: CooperativeLoadParameters  # its control is replaced by the received command
    method: Any  # `Method()` of an integrator
    steps: int  # per tick
    step: float  # [s]
    interval: float  # [s] length of a tick
    last: int  # last tick of the run
    off: RotorWrenches  # output of the controller before its first command


@always_inline
def _zero(values: tuple, i: int) -> Vec3:
    return ZERO


@always_inline
def step(
    p: CooperativePlant, s: CooperativeLoadState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[CooperativeLoadState, tuple[TrueState, BodyMotions], int]:
    """Integrate to `tick` under the received command; the true state is that of the load."""
    g = p.formation
    lift = inputs[0].value if inputs[0].due else p.off
    g = CooperativeLoadParameters(
        g.quad_mass, g.quad_inertia, g.link_length, g.load_mass, g.gravity, LiftCommand(lift.thrust, lift.moment_body)
    )
    x = s
    if tick > 0:
        x = integrate_fixed(p.method, g, (tick - 1) * p.interval, x, p.step, p.steps)
    truth = motion_alone(x.load_position, NO_ROTATION, x.load_velocity, ZERO)
    nothing = map_index(_zero, x.link, x.link)
    bodies = BodyMotions(
        (x.load_position,) + map_index(quad_position, x.link, g, x),  # noqa: RUF005 (compiled tuples have no unpacking)
        (NO_ROTATION,) + x.attitude,  # noqa: RUF005
        (x.load_velocity,) + map_index(quad_velocity, x.link, g, x),  # noqa: RUF005
        (ZERO,) + x.omega_body,  # noqa: RUF005
        (ZERO,) + nothing,  # noqa: RUF005
        (ZERO,) + nothing,  # noqa: RUF005
    )
    return x, (truth, bodies), termination_status(tick, p.last, finite(x))


LOAD = "load"


def check(scene: Scene) -> None:
    """Check that the scene describes the formation and controls it at every tick."""
    require_tables(scene, "cooperative_load", "formation")
    reject_other_tables(scene)
    rate = scene[Communication].rate
    if scene[Rates].body_states != rate:
        expected = f"communication.rate = {rate} Hz, the rate of the control"
        raise ConfigError("rates.body_states", f"got {scene[Rates].body_states} Hz", expected)
    check_system(scene, *system(scene))


def resolve(scene: Scene) -> ServiceConfig:
    """Return the configuration of the formation's plant."""
    p, start = system(scene)
    n = len(p.link_length)
    off = RotorWrenches((0.0,) * n, (ZERO,) * n)
    core = CooperativePlant(p, *method(scene), scene[Communication].interval, last_tick(scene), off)
    names = (LOAD, *[f"quad{i + 1}" for i in range(n)])
    ports = (Port(TRUTH, TrueState()), bodies_port(scene, len(names)))
    inputs = (InputPort(LIFT, scene[Communication].loop_delay),)
    return ServiceConfig(
        PlantConfig("cooperative_load", core, start, message_contents(scene, bodies=names)), inputs, ports
    )


def system(scene: Scene) -> tuple[CooperativeLoadParameters, CooperativeLoadState]:
    """Return the parameters with the rotors off, and the initial state."""
    c = scene[CooperativeLoad]
    n = len(c.link_length)
    off = LiftCommand((0.0,) * n, (ZERO,) * n)
    p = CooperativeLoadParameters(c.quad_mass, c.quad_inertia, c.link_length, c.load_mass, c.gravity, off)
    links = tuple(Swing(direction, ZERO) for direction in c.link_start)
    return p, CooperativeLoadState(c.load_start, c.load_velocity_start, (NO_ROTATION,) * n, (ZERO,) * n, links)
