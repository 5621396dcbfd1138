"""The functions of `import lapwing`."""

from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from os import cpu_count
from pathlib import Path
from typing import Any

import numpy as np

from cosim.scene import Overrides, Scene, SceneError
from cosim.setup import Setup
from lapwing.distributions import Distribution
from lapwing.flight import Flight
from services import table
from services.common.user_code import lent
from services.table import reseed, resolve
from studies import fly as studied


def load(scene: Scene | str | Path, overrides: Overrides = ()) -> Scene:
    """Read a scene and all that it names, override, and validate.

    Args:
        scene: path of its TOML file, or the name of one that ships: "hover"; or a loaded one, to override more of it.
        overrides: values by dotted key, {"effects.wind_random.mean": (3.0, 1.0, 0.0)}, or texts "KEY=VALUE"; of any key
            that the scene resolves to, "airframe.rotors.inertia" too. Units are those of the scene reference: SI.

    Raises:
        SceneError: what is wrong with which key, and what would be right.
    """
    return table.load(scene, overrides)


def fly(
    scene: Scene | str | Path,
    overrides: Overrides = (),
    seed: int | None = None,
    *,
    controller: Any = None,
    controller_options: Mapping[str, Any] | None = None,
    estimator: Any = None,
    estimator_options: Mapping[str, Any] | None = None,
) -> Flight:
    """Fly a scene in this process, as fast as it goes; the flight stays in memory.

    Where a state ceases to be sound, or the controller fails in the air, the flight ends there; its `verdict` says so,
    and `failure` why.

    Args:
        scene: what to fly: a path, a name, or a loaded one.
        overrides: as of `load`.
        seed: of all randomness, 0 to 2^63 - 1; None: the scene's.
        controller: one's own in the place of the scene's: a class, an object of one (each take-off begins with a copy
            of it), or "module:Class", as in a scene. It has a `rate` [Hz] and `step(time, estimate, setpoint)`; see
            `services.common.controllers`. A class in a module of its own becomes part of the flight's set-up, so that
            `lapwing refly` can fly a saved log again; one that was typed at a prompt or in a script cannot be.
        controller_options: of the constructor of the class: numbers, texts, lists of numbers, by name.
        estimator: the same of an estimator, with `step(time, readings)`; see `services.common.estimators`.
        estimator_options: the same.

    Raises:
        SceneError: the scene is not sound, or the controller does not fit it: what is wrong with which key.
    """
    given = {"controller": (controller, controller_options), "estimator": (estimator, estimator_options)}
    folder = Path(scene.path if isinstance(scene, Scene) else scene).parent
    with ExitStack() as stack:
        own: dict[str, Any] = {} if seed is None else {"run.seed": seed}
        for key, (thing, options) in given.items():
            if thing is not None:
                own[f"autopilot.{key}"] = stack.enter_context(lent(thing, folder))
            if options:
                own[f"autopilot.{key}_options"] = dict(options)
        return _flown(resolve(load(load(scene, overrides), own)))


def read(log: str | Path) -> Flight:
    """The flight of an MCAP log.

    Raises:
        ValueError: no such file, no MCAP log, or no flight in it.
    """
    return Flight.read(log)


def campaign(
    scene: Scene | str | Path,
    seeds: Iterable[int] = range(1, 101),
    vary: Mapping[str, Distribution] | None = None,
    overrides: Overrides = (),
) -> list[Flight]:
    """Fly a scene many times, on all processors.

    Args:
        scene: what to fly: a path, a name, or a loaded one.
        seeds: of the randomness of each flight, and of what is varied in it.
        vary: how keys of the scene vary from flight to flight: {"vehicle.mass": lapwing.normal(10.4, 0.2)}.
        overrides: as of `load`.

    Returns:
        A flight for each seed, in their order. The same seed gives the same flight, whatever the others are.

    Raises:
        SceneError: the scene is not sound, or what was drawn does not fit it.
    """
    base, varied = load(scene, overrides), dict(vary or {})
    for key, distribution in varied.items():
        if not callable(distribution):
            raise SceneError(key, f"got {distribution!r}", "a distribution, for example lapwing.normal(10.4, 0.2)")
    fixed = None if varied else resolve(base)

    def setup(seed: int) -> Setup:
        if fixed is not None:
            return reseed(fixed, seed)
        generator = np.random.default_rng(seed)
        drawn = {key: distribution(generator) for key, distribution in varied.items()}
        return resolve(load(base, {**drawn, "run.seed": seed}))

    chosen = list(seeds)
    first = [_flown(setup(seed)) for seed in chosen[:1]]  # alone: it compiles
    with ThreadPoolExecutor(cpu_count()) as pool:
        return first + list(pool.map(lambda seed: _flown(setup(seed)), chosen[1:]))


def _flown(setup: Setup) -> Flight:
    return studied.fly(setup, kind=Flight)
