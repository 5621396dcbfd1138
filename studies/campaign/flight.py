"""One flight of a campaign: in the compiled closed loop where that can fly it, else by the services."""

from typing import Any

import numpy as np

from dynamics.cell import Cell
from dynamics.geodesy import MAGNETIC_FIELD_WORLD, Home
from messages import VehicleState
from messages.topics import STATUS
from services.autopilot import control
from services.autopilot.commander.pilot import POSITION_LOST
from services.autopilot.config import Autopilot
from services.plant.models import reduced
from services.plant.models.multibody import Multibody
from services.scene import Scene
from services.sections import Exchange, Run, follows_trajectory, gravity, period
from services.sensors.service import TEMPERATURE
from services.table import lockstep_services
from studies.campaign import by_services, loop
from studies.campaign.record import FlightRecord, Flown, blank

DOUBT = 0.5  # [s] without a sure position after which a pilot may take over


def seeded(scene: Scene, seed: int) -> Scene:
    """The scene with another seed."""
    return scene.replaced(scene[Run].model_copy(update={"seed": seed}))


def fly(scene: Scene) -> Flown:
    """Fly the scene to its end: compiled, unless the pilot may act or propellers break, in the services only.

    Raises:
        ValueError: nobody flies along a trajectory in this scene.
    """
    if not scene.has(Autopilot) or not follows_trajectory(scene):
        raise ValueError(f"{scene.path}: expected a scene whose autopilot follows a [trajectory]")
    breaks = scene.has(Multibody) and scene[Multibody].event
    if breaks or scene[Autopilot].operator or scene.tables("effects").get("battery") is not None:
        return by_services.fly(scene)
    flown, failed_motor = fly_compiled(scene)
    acts = failed_motor > 0 or _doubtful(flown.record, scene[Exchange].rate)
    return by_services.fly(scene) if acts else flown


def _doubtful(record: FlightRecord, rate: int) -> bool:
    """Whether the position was lost for so long that the pilot may have acted."""
    lost = record.armed & (record.health & POSITION_LOST != 0)
    sure = np.flatnonzero(~np.concatenate([[False], lost, [False]]))
    return bool(np.diff(sure).max() - 1 > DOUBT * rate)


def fly_compiled(
    scene: Scene, plant: reduced.Core | None = None, controller: control.Parameters | None = None
) -> tuple[Flown, int]:
    """Fly the scene to its end in the compiled loop, without a pilot.

    Args:
        scene: what to fly.
        plant: another plant than the scene's.
        controller: other parameters of the controller than the scene's.

    Returns:
        The flight, and the number of a motor that the autopilot took for failed (0: none).
    """
    services: dict[str, Any] = lockstep_services(scene)
    core = services["autopilot"].core
    if controller is not None:
        core = core._replace(parameters=Cell(controller))
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
    ticks, finite, finished, failed_motor = loop.fly(
        plant or services["plant"].core, carried, core, path, around, timing, record
    )
    record = FlightRecord(*(column[:ticks] for column in record))
    return Flown(record, finite, finished), failed_motor


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
