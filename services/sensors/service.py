"""Sensor service: a compiled block for each instrument, true state in, readings out at the sensor's rate."""

import sys
from typing import Any, NamedTuple

from numba import types

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import CONTINUE, Block, InputSample
from lapwing.cosim.diagram.topic_encoder import TopicEncoder
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.noise import Key
from lapwing.dynamics.terrain import surface
from lapwing.dynamics.vector import subtract
from lapwing.dynamics.vehicles.visible_body import VisibleBody
from lapwing.kernels import DispatchTable, always_inline
from lapwing.kernels.cell import Cell
from lapwing.kernels.codegen import compile_source, dispatch, generic
from lapwing.services.common.encoders import reading_encoder
from lapwing.services.sensors.encoders import PORTS, topic_encoders
from lapwing.services.sensors.sensor_inputs import ROTORS, OtherVehicle, Rotors, Truth

NAME = "sensors"


class Instrument(NamedTuple):
    """Parameters of the block."""

    sensor: Any  # parameters: Imu, Gps, ...
    key: Key  # key of its random numbers
    environment: Environment  # its gravity is that at home, 0 without a gravity effect
    others: tuple[VisibleBody, ...] = ()  # vehicles that it sees, in the order of its further inputs


_sample = dispatch(DispatchTable("sample"))
_initial = dispatch(DispatchTable("initial"))


@generic(inline=True)
def first_rotors(speed: types.Type) -> Any:
    """Return the speeds of ROTORS rotors, 0 beyond the vehicle's number."""
    items = ", ".join(f"speed[{i}]" if i < len(speed) else "0.0" for i in range(ROTORS))
    return compile_source("first_rotors(speed)", {}, f"return ({items})")


@generic(inline=True)
def _other_vehicles(bodies: types.Type, inputs: types.Type) -> Any:
    """Return the `OtherVehicle`s, whose true states follow the vehicle's own in the inputs."""
    items = "".join(
        f"OtherVehicle(inputs[{i + 1}].value.position_world, inputs[{i + 1}].value.attitude, bodies[{i}]), "
        for i in range(len(bodies))
    )
    return compile_source("other_vehicles(bodies, inputs)", {"OtherVehicle": OtherVehicle}, f"return ({items})")


@always_inline
def step(p: Instrument, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple, int]:
    """Output the reading at `tick`; the instrument starts at tick 0."""
    x = inputs[0].value
    ground, _ = surface(p.environment.terrain, x.position_world[0], x.position_world[1])
    current, thrust, speed = 0.0, 0.0, 0.0
    for value in x.motor_current:
        current += value
    for value in x.rotor_thrust:
        thrust += value
    for value in x.rotor_speed:
        speed += value
    truth = Truth(
        x.position_world,
        x.attitude,
        x.velocity_world,
        x.omega_body,
        x.acceleration_world,
        x.angular_acceleration_body,
        x.position_world[2] - ground,
        subtract(x.velocity_world, x.wind_world),
        x.air_density,
        Rotors(speed / len(x.rotor_speed), first_rotors(x.rotor_speed), thrust, current),
        p.environment,
        _other_vehicles(p.others, inputs),
    )
    if tick == 0:
        s = _initial(p.sensor, p.key, truth)
    s, reading = _sample(p.sensor, s, p.key, tick, truth)
    return s, (reading,), CONTINUE


def create(config: RunConfig) -> Service:
    """Return the sensors of a run, whose parameters are its instruments in the order of their ports."""
    settings = config.services[NAME]
    instruments: tuple[Instrument, ...] = settings.parameters
    blocks: list[Block] = []
    encoders: list[TopicEncoder] = []
    for p, port in zip(instruments, settings.ports, strict=True):
        module, inputs = sys.modules[type(p.sensor).__module__], settings.inputs[: 1 + len(p.others)]
        blocks.append(Block(f"{NAME}.{port.name}", p, Cell(module.blank()), inputs, (port,), port.period))
        if port.name not in PORTS:
            own = module.__name__ == f"{__package__}.{port.name}" and hasattr(module, "topic_encoders")
            generic_encoder = [] if own else [reading_encoder(config.vehicle, port)]
            encoders += module.topic_encoders(config.vehicle, port, p) if own else generic_encoder
    sensors = {port.name: p.sensor for p, port in zip(instruments, settings.ports, strict=True)}
    return Service(NAME, blocks, encoders + topic_encoders(config, sensors))
