"""Quadrotors that carry a point mass by rigid links: thrusts and moments in, states of all bodies out."""

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.lie.ts2 import Swing
from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles.cooperative_load import CooperativeLoadParameters, CooperativeLoadState, LiftCommand
from lapwing.services.common.communication_schema import Communication, Rates
from lapwing.services.common.ports import LIFT, TRUTH, RotorWrenches, TrueState
from lapwing.services.common.run_schema import CooperativeLoad
from lapwing.services.plant.blocks.cooperative_load import CooperativePlant
from lapwing.services.plant.models._common import (
    bodies_port,
    check_system,
    last_tick,
    message_contents,
    reject_other_tables,
    require_tables,
)
from lapwing.services.plant.schema import method
from lapwing.services.plant.service_config import PlantSetup

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
        PlantSetup("cooperative_load", core, start, message_contents(scene, bodies=names)), inputs, ports
    )


def system(scene: Scene) -> tuple[CooperativeLoadParameters, CooperativeLoadState]:
    """Return the parameters with the rotors off, and the initial state."""
    c = scene[CooperativeLoad]
    n = len(c.link_length)
    off = LiftCommand((0.0,) * n, (ZERO,) * n)
    p = CooperativeLoadParameters(c.quad_mass, c.quad_inertia, c.link_length, c.load_mass, c.gravity, off)
    links = tuple(Swing(direction, ZERO) for direction in c.link_start)
    return p, CooperativeLoadState(c.load_start, c.load_velocity_start, (NO_ROTATION,) * n, (ZERO,) * n, links)
