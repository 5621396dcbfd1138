"""`[solver] accuracy`: the cheapest integrator and step for a scene, measured once and remembered."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

from dynamics.kernel import CACHE, cache_folder
from services.plant.config import Solver
from services.scene import Scene
from services.sections import Effects, Exchange, Run, Vehicle
from studies.accuracy import scenes
from studies.accuracy.measure import Point, cheapest, measure


def overrides(scene: Scene, say: Callable[[str], None]) -> list[str]:
    """What is to be set so that the scene's accuracy is met at the least cost; nothing where a step is given.

    Args:
        scene: any scene.
        say: told of a measurement before it begins.

    Raises:
        ValueError: no integrator meets the accuracy on this plant.
    """
    solver = scene[Solver]
    if not solver.undecided:
        return []
    assert solver.accuracy is not None
    points = _points(scene, say)
    if "integrator" in solver.model_fields_set:
        points = [p for p in points if p.way == solver.integrator]
    try:
        chosen = cheapest(points, solver.accuracy)
    except ValueError as error:
        reason = str(error).partition(": ")[2]
        raise ValueError(f"{scene.path}: solver.accuracy: {solver.accuracy:g}: {reason}") from None
    # the step that `Solver.check` takes for a divisor of the interval
    return [f'solver.integrator="{chosen.way}"', f"solver.step={chosen.setting!r}"]


def _points(scene: Scene, say: Callable[[str], None]) -> list[Point]:
    """The points of the scene's plant: from the user's cache, so that every later run flies the same."""
    path = _file(scene)
    if path.exists():
        return [Point(**entry) for entry in json.loads(path.read_text(encoding="utf-8"))]
    say("measuring the integrators on this plant for solver.accuracy (first time only; minutes if they are compiled)")
    points = measure(scenes.problem(scene))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps([p._asdict() for p in points]), encoding="utf-8")
    return points


def _file(scene: Scene) -> Path:
    """Named by the state of the kernels and by all that the plant is made of, but for how it is to be solved."""
    digest = hashlib.blake2b(Path(cache_folder("dynamics")).name.encode(), digest_size=8)
    run = scene[Run]
    for part in (
        run.seed,
        scene[Vehicle].name,
        run.duration,
        scene[Exchange].rate,
        dict(scene[Effects].tables),
        scenes.physics(scene),
    ):
        digest.update(repr(part).encode())
    return CACHE / "accuracy" / f"{scene.name}-{digest.hexdigest()}.json"
