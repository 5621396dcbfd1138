"""Formation control service: thrust [N] and moment [N m] of each vehicle that carries the load."""

from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import CONTINUE, Block, InputSample
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.dynamics.lie.ts2 import Swing, normalise
from lapwing.dynamics.vector import Vec3, cross, norm, scale, subtract
from lapwing.kernels import always_inline
from lapwing.kernels.cell import Cell
from lapwing.kernels.codegen import map_index
from lapwing.messages import RotorWrench, Vector3, header
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.papers.cooperative_load.cooperative_control import formation_control
from lapwing.papers.cooperative_load.cooperative_load import CooperativeLoadParameters, CooperativeLoadState
from lapwing.services.common import ports
from lapwing.services.common.ports import RotorWrenches

NAME = "formation"


class FormationLaw(NamedTuple):
    """Parameters of the control law."""

    formation: CooperativeLoadParameters
    interval: float  # [s] length of a tick


@always_inline
def link(load: Vec3, speed: Vec3, positions: tuple[Vec3, ...], velocities: tuple[Vec3, ...], i: int) -> Swing:
    """Return the direction from quadrotor i to the load and the angular velocity [rad/s] of link i, world axes.

    Positions are in [m], velocities in [m/s].
    """
    d = subtract(load, positions[i])
    along = 1.0 / norm(d)
    direction = scale(along, d)
    return normalise(Swing(direction, cross(direction, scale(along, subtract(speed, velocities[i])))))


@always_inline
def step(p: FormationLaw, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[RotorWrenches], int]:
    """Compute the rotor wrenches; the first body is the load, the others are the quadrotors. The state is unused."""
    b = inputs[0].value
    load, velocity = b.position_world[0], b.velocity_world[0]
    attitudes, omegas = b.attitude[1:], b.omega_body[1:]
    links = map_index(link, attitudes, load, velocity, b.position_world[1:], b.velocity_world[1:])
    x = CooperativeLoadState(load, velocity, attitudes, omegas, links)
    command = formation_control(p.formation, tick * p.interval, x)
    return s, (RotorWrenches(command.thrust, command.moment_body),), CONTINUE


def create(config: RunConfig) -> Service:
    """Return the formation control of a run."""
    settings = config.services[NAME]
    n = len(config.port(ports.LIFT).example.thrust)
    message = RotorWrench(header(0, "body"), (0.0,) * n, (Vector3(),) * n)
    encoder = TopicEncoder(topic.LIFT, ports.LIFT, 1, _lift, lambda: message)
    return Service(NAME, [Block(NAME, settings.parameters, Cell(0.0), settings.inputs, settings.ports)], [encoder])


def _lift(x: RotorWrenches, time_ns: np.ndarray) -> Fields:
    fields: dict[str, Any] = {**stamp_columns(time_ns), "thrust": x.thrust}
    for i, moment in enumerate(x.moment_body):
        fields[f"moment.{i}"] = moment
    return fields
