"""One flight of a campaign: in the compiled closed loop where that can fly it, else by the services."""

from typing import Any, NamedTuple

import numpy as np

from dynamics.cell import Cell
from dynamics.geodesy import MAGNETIC_FIELD_WORLD, Home
from messages import VehicleState
from messages.topics import STATUS
from services.autopilot.config import Autopilot
from services.scene import Scene
from services.sections import Exchange, Run, follows_trajectory, gravity, period
from services.sensors.service import TEMPERATURE
from services.table import lockstep_services
from studies.campaign import loop

SHAPES = {"attitude": 4, "setpoint_world": 4, "tilt_reference": 2, "motor_voltage": 4, "estimated_attitude": 4}
FLAT = {"power": float, "in_contact": bool, "armed": bool, "health": int}


class Flown(NamedTuple):
    """A flight: its record, and how it ended."""

    record: loop.FlightRecord
    finite: bool  # all numbers to the end
    finished: bool  # the mission ended before the run


def seeded(scene: Scene, seed: int) -> Scene:
    """The scene with another seed."""
    return scene.replaced(scene[Run].model_copy(update={"seed": seed}))


def refusal(scene: Scene) -> str:
    """Why the compiled loop cannot fly this scene; "" where it can."""
    if not scene.has(Autopilot) or not follows_trajectory(scene) or scene[Autopilot].operator:
        return "expected a scene whose autopilot follows a [trajectory], without an operator"
    return ""


def blank(ticks: int) -> loop.FlightRecord:
    """A record of so many rows, all zero."""
    columns = {}
    for name in loop.FlightRecord._fields:
        kind = FLAT.get(name)
        columns[name] = np.zeros(ticks, kind) if kind else np.zeros((ticks, SHAPES.get(name, 3)))
    return loop.FlightRecord(**columns)


def fly(scene: Scene) -> Flown:
    """Fly the scene to its end in the compiled loop.

    Raises:
        ValueError: the loop cannot fly it.
    """
    if why := refusal(scene):
        raise ValueError(f"{scene.path}: {why}")
    services: dict[str, Any] = lockstep_services(scene)
    core = services["autopilot"].core
    path, final = services["trajectory"].core
    exchange, run = scene[Exchange], scene[Run]
    timing = loop.Timing(
        exchange.loop_delay,
        period(scene, STATUS),
        final,
        round(run.duration * exchange.rate),
        round(run.settle * exchange.rate),
    )
    around = loop.Surroundings(gravity(scene), Home(), TEMPERATURE, MAGNETIC_FIELD_WORLD)
    carried = None if core.navigation.state is None else _carried(services["sensors"], exchange.interval_ns)
    record = blank(timing.last + 1)
    ticks, finite, finished = loop.fly(
        services["plant"].core, carried, core.navigation, core.parameters, core.state, path, around, timing, record
    )
    return Flown(loop.FlightRecord(*(column[:ticks] for column in record)), finite, finished)


def _carried(sensors: Any, interval_ns: int) -> loop.Carried:
    """The sensors as the loop takes them."""
    found = {}
    every = {i.name: i.every for i in sensors.instruments}
    for name, module, p, key, ticks in sensors.instruments:
        late = getattr(p, "latency_samples", 0) / p.rate if name == "gps" else 0.0
        age = round(round(late * 1e9) / interval_ns / every["imu"])
        state = module.initial(p, key, sensors.truth(VehicleState()))
        found[name] = loop.SampledSensor(Cell(p), Cell(state), key, ticks, age)
    return loop.Carried(**{name: found.get(name) for name in loop.Carried._fields})
