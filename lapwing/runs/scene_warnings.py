"""Parts of a scene that can be flown but hardly do what their author expects."""

from collections.abc import Iterator
from math import ceil

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.cosim.scene import Scene
from lapwing.dynamics.effects._wind_use import uses_wind
from lapwing.dynamics.terrain import Level, surface
from lapwing.dynamics.vehicles.step_bound import FASTEST_RATE, causes
from lapwing.services.common.plans.fence import Fence
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.fence_schema import FenceTable
from lapwing.services.common.schemas.vehicle_schema import Effects, Vehicle, start_place
from lapwing.services.plant import models
from lapwing.services.plant.schema import Solver, limited_by_round_off, method
from lapwing.services.trajectory.schema import compile_trajectory
from lapwing.services.trajectory.service import TrajectoryConfig, ordered_path

MANY_PARTS = 8  # of a step, from which the cause is printed
RIGID = ("rigid_body", "multibody")  # models of a multirotor without a load, which the wind moves by itself
DEPTH = 0.01  # [m] below the surface, from which a place of a trajectory is in an obstacle


def warnings(scene: Scene, config: RunConfig) -> Iterator[str]:
    """Yield a line for each: where, what is wrong, what would be right."""
    for vehicle, member in zip(scene.each_vehicle, members(config), strict=True):
        yield from _round_off(vehicle)
        yield from _split_steps(vehicle)
        yield from (f"{prefix(scene, vehicle)}{line}" for line in _wind(vehicle))
        if trajectory := ordered_path(member):
            yield from (f"{prefix(scene, vehicle)}{line}" for line in _trajectory(vehicle, member, trajectory))


def prefix(scene: Scene, vehicle: Scene) -> str:
    """Return the name of a vehicle of a fleet, for the beginning of a line; "" for one vehicle."""
    return f"{vehicle.lookup('vehicle.name')}: " if scene.vehicles else ""


def _round_off(vehicle: Scene) -> Iterator[str]:
    """Yield a line if the substeps in contact reach round-off before their accuracy."""
    if limit := limited_by_round_off(vehicle):
        (name, least), accuracy = limit, vehicle[Solver].accuracy
        message = f"substeps of {name} are limited by round-off, and {accuracy:g} may be missed in contact"
        yield f"solver.accuracy: {message}; use at least {least:g}"


def _split_steps(vehicle: Scene) -> Iterator[str]:
    """Yield a line with the cause if the steps are split into many parts."""
    model = models.get(vehicle[Vehicle].model)
    if not hasattr(model, "describe"):
        return
    formulation, p = model.describe(vehicle)
    fastest, step = causes(p, formulation.initial_state(p).memory)[0], method(vehicle)[2]
    if (number := fastest.rate * step / FASTEST_RATE) > MANY_PARTS:
        message = f"{fastest.name} (decay within {1e3 / fastest.rate:.2g} ms) split each step of {1e3 * step:g} ms"
        yield f"solver: {message} into {number:.0f}, which costs most of the time"


def _wind(vehicle: Scene) -> Iterator[str]:
    """Yield a line if a wind of the scene moves nothing."""
    winds = [name for name in vehicle[Effects].tables if name.startswith("wind_")]
    if not winds or vehicle[Vehicle].model not in RIGID or "shared_slung_load" in vehicle[Effects].tables:
        return
    if not any(uses_wind(effect) for effect in models.get(vehicle[Vehicle].model).describe(vehicle)[1].effects):
        message = "does not move the vehicle: no effect of the scene uses it; add body_drag or axial_inflow"
        yield f"effects.{winds[0]} {message}"


def _trajectory(vehicle: Scene, member: RunConfig, trajectory: TrajectoryConfig) -> Iterator[str]:
    """Yield a line for a trajectory longer than the run, outside of the fence, or through an obstacle."""
    needed = compile_trajectory(vehicle).duration
    shortened = any(each.key == "run.duration" for each in vehicle.file_overrides or ())  # on purpose
    if needed > member.duration and not shortened:
        yield f"run.duration: {member.duration:g} s end the run before its trajectory; use at least {ceil(needed)} s"
    terrain, fenced = environment(vehicle).terrain, vehicle.has(FenceTable)
    if not fenced and isinstance(terrain, Level):
        return
    track = list(trajectory.track(member.duration))
    if fenced:
        fence = Fence(vehicle[FenceTable].items())
        for time, phase, x, y, _ in track:
            if breach := fence.breach(x, y):
                yield f"{_place(time, phase, x, y)} is {breach}; move it or the fence"
                break
    if isinstance(terrain, Level):
        return
    x0, y0, z0 = start_place(vehicle)
    start, last = surface(terrain, x0, y0)[0], (x0, y0)
    for time, phase, x, y, z in track:
        sideways, last = (x, y) != last, (x, y)  # a descent may end on an obstacle
        if sideways and (height := surface(terrain, x, y)[0] - start) > z - z0 + DEPTH:
            yield f"{_place(time, phase, x, y)} is inside an obstacle {height:.1f} m high, at {z - z0:.1f} m"
            break


def _place(time: float, phase: str, x: float, y: float) -> str:
    return f"trajectory: x = {x:z.1f} m, y = {y:z.1f} m at t = {time:.1f} s in phase {phase!r}"
