"""`[solver] accuracy`: cheapest integrator and step for a scene, from cached measurements.

The solvers repeat the commands that the scene's own flight records. If it has commands from outside, fails or is long,
they fly manoeuvres instead, which are harder than most flights. The choice counts evaluations of the right-hand side,
so it is a function of the scene and the version alone.
"""

import hashlib
import json
import math
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

from lapwing.cosim.complete_file import complete_file
from lapwing.cosim.scene import KeyOrigin, Scene, SceneError
from lapwing.dynamics.config_error import ConfigError
from lapwing.kernels import cache_folder
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.run_schema import Run
from lapwing.services.common.schemas.vehicle_schema import Effects, Vehicle
from lapwing.services.plant.schema import Solver, accuracy_to_select_for
from lapwing.services.scene_resolver import load
from lapwing.studies.accuracy import flight_accuracy, own_flight, plant, scenes
from lapwing.studies.accuracy.error_budget import acting_on_neighbours
from lapwing.studies.accuracy.problem import SolverMethod
from lapwing.studies.accuracy.work_precision import FINE_ENOUGH, Point, cheapest, measure

CANDIDATES = ("rkmk2", "rk4_renormalised", "rkmk54", "rk8_renormalised")  # each the cheapest for some system and error
IMPACT_SHARE = 3e-3  # of the accuracy, because an impact amplifies position errors to 300 times larger velocity errors
JUMP_SHARE = 0.125  # of the accuracy while voltages jump, because the largest error of such flights is 7 times larger
MOST_STEPS = 32  # per communication step, half of those of the reference: the finest step that is tried
SOURCES = "kernels", "dynamics", "cosim", "services", "studies/accuracy"  # folders that decide on a measurement
HIDDEN = 2.0  # factor by which a finer step errs more if the longer one is under error control


def overrides(scene: Scene, notify: Callable[[str], None]) -> list[str]:
    """Return the overrides that meet the scene's accuracy at the lowest cost; [] if the scene sets a step.

    All vehicles of a fleet get the same solver, which meets the accuracy of each vehicle in free flight.

    Args:
        scene: any scene.
        notify: called with a message before a measurement.

    Raises:
        SceneError: no integrator meets the accuracy on this plant.
    """
    accuracy = accuracy_to_select_for(scene)
    if accuracy is None:
        return []
    chosen = as_overrides(*select(scene, accuracy, notify))
    _warn_of_neighbours(scene, chosen, accuracy, notify)
    return chosen


def as_overrides(method: str, step: float) -> list[str]:
    """Return overrides with the exact step [s], which `Solver.check` accepts as a divisor of the communication step."""
    return [f'solver.integrator="{method}"', f"solver.step={step!r}"]


def select(scene: Scene, accuracy: float, notify: Callable[[str], None]) -> tuple[str, float]:
    """Return (integrator, step [s]) that meets the accuracy in the scene at the lowest cost.

    Raises:
        SceneError: no integrator meets the accuracy on this plant.
    """
    try:
        return _for_own_flight(scene, accuracy, notify) or _for_manoeuvres(scene, accuracy, notify)
    except ConfigError as error:
        message = f"{accuracy:g}: {error.message}"
        raise SceneError("solver.accuracy", message, source=KeyOrigin(scene.path)) from None


def _for_own_flight(scene: Scene, accuracy: float, notify: Callable[[str], None]) -> tuple[str, float] | None:
    """Return (integrator, step [s]) for the scene's own flight; None if it has no known commands, fails or is long.

    Raises:
        ConfigError: no integrator meets the accuracy.
    """
    if not own_flight.has_known_commands(scene):
        return None
    first = scene.each_vehicle[0]
    more = f"{accuracy!r} {scene.resolved!r}"
    path = _cache_file(first, _names(first, own_flight.CANDIDATES), more)
    if path and path.is_file():
        with suppress(OSError, ValueError):
            method, step = json.loads(path.read_text(encoding="utf-8"))
            return (str(method), float(step)) if method else None
    notify("flying the scene with each integrator for solver.accuracy (first time only)")
    try:
        flight = own_flight.OwnFlight(scene, accuracy)
    except ValueError:
        _store(path, json.dumps(["", 0.0]))
        return None
    selected = flight.cheapest(_names(first, own_flight.CANDIDATES), accuracy)
    _store(path, json.dumps([selected.method, selected.setting]))
    return selected.method, selected.setting


def _for_manoeuvres(scene: Scene, accuracy: float, notify: Callable[[str], None]) -> tuple[str, float]:
    """Return (integrator, step [s]) for manoeuvres of each vehicle in free flight.

    Raises:
        ConfigError: no integrator meets the accuracy.
    """
    distinct = {repr(scenes.physics(vehicle)): vehicle for vehicle in scene.each_vehicle}.values()
    points = _combine_vehicles([_expected_points(vehicle, accuracy, notify) for vehicle in distinct])
    selected = cheapest(points, accuracy)
    return selected.method, selected.setting


def _names(scene: Scene, candidates: tuple[str, ...] = CANDIDATES) -> tuple[str, ...]:
    """Return the names of the integrators from which one is selected."""
    solver = scene[Solver]
    return (solver.integrator,) if "integrator" in solver.model_fields_set else candidates


def _warn_of_neighbours(scene: Scene, chosen: list[str], accuracy: float, notify: Callable[[str], None]) -> None:
    """Notify if states of neighbours, held over a communication step, have an error above the accuracy."""
    names = ", ".join(acting_on_neighbours(scene))
    if not names:
        return
    first = scene.each_vehicle[0]
    path, error = _cache_file(first, tuple(chosen), repr(scene.resolved)), math.nan
    if path and path.is_file():
        with suppress(OSError, ValueError):
            error = float(path.read_text(encoding="utf-8"))
    if math.isnan(error):
        notify(f"measuring the error of {names} between vehicles (first time only)")
        error = flight_accuracy.error_of_neighbours(load(scene, chosen))
        _store(path, repr(error))
    if error > accuracy:
        message = f"{names} between vehicles, at {first[Communication].rate} Hz, err by {error:.2g}, above {accuracy:g}"
        notify(f"warning: solver.accuracy: {message}; no step reduces it, a higher communication.rate does")


def _combine_vehicles(vehicles: list[list[Point]]) -> list[Point]:
    """Return the points common to all vehicles, with the largest error."""
    by_key = [{(p.method, p.setting): p for p in points} for points in vehicles]
    common = [[points[key] for points in by_key] for key in by_key[0] if all(key in points for points in by_key)]
    return [same[0]._replace(error=max(p.error for p in same)) for same in common]


def _expected_points(scene: Scene, accuracy: float, notify: Callable[[str], None]) -> list[Point]:
    """Return the points of one vehicle with the largest errors expected in flight."""
    names = _names(scene)
    gentle, *others = (
        [p for p in points if p.method in names or len(names) > 1] for points in _points(scene, names, notify)
    )
    return _expected_errors(gentle, _share(scene, gentle, accuracy) / accuracy, others)


def _expected_errors(gentle: list[Point], share: float, others: list[list[Point]]) -> list[Point]:
    """Return the points of all flights with the largest errors expected in flight."""
    flights = [(gentle, share), *((points, JUMP_SHARE) for points in others)]
    by_key = {(p.method, p.setting): p for points, _ in reversed(flights) for p in points}
    return [
        p._replace(error=max(_error(points, p.method, p.setting) / part for points, part in flights))
        for p in by_key.values()
    ]


def _error(points: list[Point], method: str, step: float) -> float:
    """Return the error of a step in a flight; infinity if it is unknown.

    A flight is not repeated with finer steps once its error is round-off, so the error of the next longer step is an
    upper bound. A step with a smaller error than a finer one was under error control, as at the limits of the motors:
    the flight does not show the error that this step has elsewhere.
    """
    errors = {p.setting: p.error for p in points if p.method == method}
    longer = [setting for setting in errors if setting >= step]
    if not longer:
        return math.inf
    result = errors[min(longer)]
    hidden = any(errors[setting] > max(HIDDEN * result, FINE_ENOUGH) for setting in errors if setting < step)
    return math.inf if hidden else result


def _share(scene: Scene, points: list[Point], accuracy: float) -> float:
    """Return the error allowed in gentle flight: the accuracy, or its share for impacts if a point reaches that."""
    strict = IMPACT_SHARE * accuracy
    impacts = "ground_contact" in scene.tables("effects") and any(p.error <= strict for p in points)
    return strict if impacts else accuracy


def _points(scene: Scene, names: tuple[str, ...], notify: Callable[[str], None]) -> list[list[Point]]:
    """Return the points of the scene's plant in each manoeuvre, from the cache if available.

    Compilation of an integrator takes at least 3 s, so only `names` are measured; all if none fits the plant.
    """
    path = _cache_file(scene, names)
    if path and (cached := _read(path)):
        return cached
    problems, finest = [], (1.0 - 1e-9) * scene[Communication].interval / MOST_STEPS
    for problem in scenes.manoeuvres(scene):
        methods = [method for method in problem.methods if method.name in names] or problem.methods
        problems.append(problem._replace(methods=[_down_to(finest, method) for method in methods]))
    measured = ", ".join(method.name for method in problems[0].methods)
    notify(f"measuring {measured} on this plant for solver.accuracy (first time only)")
    points = [measure(problem, sys.maxsize, timed=False) for problem in problems]
    _store(path, json.dumps([[p._asdict() for p in each] for each in points]))
    return points


def _store(path: Path | None, text: str) -> None:
    if path is not None:
        with suppress(OSError):  # without a cache it is measured again
            path.parent.mkdir(parents=True, exist_ok=True)
            with complete_file(path) as file:
                file.write_text(text, encoding="utf-8")


def _down_to(finest: float, method: SolverMethod) -> SolverMethod:
    return method._replace(settings=[h for h in method.settings if h >= finest])


def _read(path: Path) -> list[list[Point]]:
    """Return cached measurements; [] if the file is missing or damaged."""
    with suppress(OSError, ValueError, TypeError):
        points = [[Point(**entry) for entry in each] for each in json.loads(path.read_text(encoding="utf-8"))]
        return points if all(points) else []
    return []


@cache
def _sources() -> bytes:
    """Return a digest of the files in SOURCES; their bytes, because imports take 40 times as long to follow."""
    root, digest = Path(__file__).parents[2], hashlib.blake2b()
    for file in sorted(file for part in SOURCES for file in (root / part).rglob("*.py")):
        digest.update(str(file.relative_to(root)).encode() + file.read_bytes())
    return digest.digest()


def _cache_file(scene: Scene, names: tuple[str, ...], more: str = "") -> Path | None:
    """Return the cache file, named by a digest of sources, integrators, plant and `more`; None without a cache."""
    folder = cache_folder()
    if folder is None:
        return None
    digest = hashlib.blake2b(_sources(), digest_size=8)
    run, manoeuvres = scene[Run], [voltages.__name__ for voltages in plant.MANOEUVRES]
    flight = names, manoeuvres, run.seed, scene[Vehicle].name, run.duration, scene[Communication].rate
    for part in (*flight, dict(scene[Effects].tables), scenes.physics(scene), *filter(None, [more])):
        digest.update(repr(part).encode())
    return folder / "accuracy" / f"{scene.name}-{digest.hexdigest()}.json"
