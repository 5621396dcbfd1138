"""Functions of the public interface `lapwing`."""

import warnings
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from os import cpu_count
from pathlib import Path
from typing import Any

from lapwing.api.flight import Flight
from lapwing.api.short_errors import short_errors
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.scene import Overrides, Scene, SceneError
from lapwing.runs import scene_warnings
from lapwing.runs.observer import notify_on_compile
from lapwing.runs.solver import with_solver
from lapwing.runs.work_progress import WorkProgress
from lapwing.services import scene_resolver
from lapwing.services.common.user_code import register
from lapwing.services.scene_resolver import reseed, resolve
from lapwing.studies import simulate
from lapwing.studies.campaign.distributions import Distribution
from lapwing.studies.campaign.plan import plan


@short_errors
def load_scene(scene: Scene | str | Path, overrides: Overrides = ()) -> Scene:
    """Read a scene and the files that it names, apply overrides, and validate it.

    Args:
        scene: path of its TOML file, name of a shipped scene ("hover"), or a loaded scene.
        overrides: values [SI] by dotted key, {"effects.random_wind_force.mean": (3.0, 1.0, 0.0)}, or texts "KEY=VALUE";
            keys of the files that it names are allowed, for example "airframe.rotors.inertia".

    Raises:
        SceneError: names the key, the fault and the expected value.
    """
    return scene_resolver.load(scene, overrides)


@short_errors
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
    """Fly a scene in this process as fast as possible. Return the flight, which stays in memory.

    A terminal or notebook shows a progress bar after 2 s, also of `campaign` and `Simulator`.
    The flight ends early if a state becomes invalid or the controller raises an error; see `outcome` and `failure`.

    Args:
        scene: path or name of a scene, or a loaded scene.
        overrides: see `load_scene`.
        seed: seed of all random numbers, 0 to 2^63 - 1; None for that of the scene.
        controller: replaces the controller of the scene: a class, an object (copied at each take-off), or
            "module:Class". It has a `rate` [Hz] and `step(time, estimate, setpoint)`; `lapwing new controller` writes
            an example. A class in a separate module becomes part of the run
            configuration, so that `lapwing resimulate` can repeat a saved log; a class of a script or prompt does not.
        controller_options: arguments of the constructor by name: numbers, texts, lists of numbers.
        estimator: replaces the estimator of the scene; it has a `rate` [Hz] and `step(time, readings)`;
            `lapwing new estimator` writes an example.
        estimator_options: arguments of the constructor by name.

    Raises:
        SceneError: the scene is invalid, or the controller does not fit it; names the key and the fault.
    """
    user_code = {"controller": (controller, controller_options), "estimator": (estimator, estimator_options)}
    base = with_solver(scene_resolver.load_one(scene, overrides))
    folder = Path(scene.path if isinstance(scene, Scene) else scene).parent
    with ExitStack() as stack:
        own: dict[str, Any] = {} if seed is None else {"run.seed": seed}
        for key, (code, options) in user_code.items():
            if code is not None:
                own[f"autopilot.{key}"] = stack.enter_context(register(code, folder))
            if options:
                own[f"autopilot.{key}_options"] = dict(options)
        loaded = load_scene(base, own)
        config = resolve(loaded)
        for line in scene_warnings.warnings(loaded, config):
            warnings.warn(line, stacklevel=3)
        return _fly_with_bar(config)


def read_log(log: str | Path) -> Flight:
    """Return the flight of an MCAP log.

    Raises:
        ValueError: the file is missing, not an MCAP log, or has no flight.
    """
    return Flight.read(log)


@short_errors
def campaign(
    scene: Scene | str | Path,
    seeds: Iterable[int] = range(1, 101),
    vary: Mapping[str, Distribution] | None = None,
    overrides: Overrides = (),
    *,
    seed: int = 1,
    design: str = "random",
) -> list[Flight]:
    """Fly a scene many times, on all processors; the flights stay in memory. See `lapwing campaign` for large numbers.

    Args:
        scene: path or name of a scene, or a loaded scene.
        seeds: seed of the random numbers of each run.
        vary: distributions of scene keys: {"vehicle.mass": lapwing.normal(10.4, 0.2)}.
        overrides: see `load_scene`.
        seed: seed of the campaign. A drawn value depends on it, on the number of the run and on the key only.
        design: sampling of the varied keys: "random", "lhs", "sobol" or "grid".

    Returns:
        The flight of each run, in order. With the seeds 1 to n and `seed` = 1, they equal those of
        `lapwing campaign --runs n`. `flight.drawn` has the drawn values by key, so that
        `pandas.DataFrame([flight.drawn | flight.rmse for flight in flights])` is a table with a row for each run.

    Raises:
        SceneError: the scene is invalid, or a drawn value does not fit it.
        ValueError: an argument is out of its range.
    """
    base = scene_resolver.load_one(scene, overrides)
    for key, distribution in (vary or {}).items():
        if not isinstance(distribution, Distribution):
            raise SceneError(key, f"got {distribution!r}", "a distribution, for example lapwing.normal(10.4, 0.2)")
    if not isinstance(seeds, Iterable):
        raise SceneError("seeds", f"got {seeds!r}", "several whole numbers, for example range(1, 101)")
    seeds = list(seeds)
    if not seeds:
        raise SceneError("seeds", "got none", "at least one")
    campaign_plan = plan(base.name, (), len(seeds), seed, vary, design=design)
    fixed = None if campaign_plan.keys else resolve(base)

    def config(run: int) -> RunConfig:
        if fixed is not None:
            return reseed(fixed, seeds[run])
        return resolve(load_scene(base, {**campaign_plan.values(run), "run.seed": seeds[run]}))

    def one(run: int) -> Flight:
        flight = _fly(config(run))
        flight.drawn = campaign_plan.values(run)
        return flight

    workers = cpu_count() or 1
    with WorkProgress(f"campaign {base.name}", len(seeds), "flights", workers) as bar:
        with notify_on_compile(config(0), bar.compiling):
            flights = [one(0)]  # one flight alone, which compiles the kernels
        bar.show(1)
        with ThreadPoolExecutor(workers) as pool:
            for flight in pool.map(one, range(1, len(seeds))):
                flights.append(flight)
                bar.show(len(flights))
    return flights


def _fly(config: RunConfig) -> Flight:
    return simulate.fly(config, kind=Flight)


def _fly_with_bar(config: RunConfig) -> Flight:
    """Fly with a progress bar, which appears if the flight takes long."""
    with (
        WorkProgress(config.scene, config.last_tick * config.interval, "s") as bar,
        notify_on_compile(config, bar.compiling),
    ):

        def observe(tick: int) -> None:
            bar.show(tick * config.interval)

        return simulate.fly(config, kind=Flight, observe=observe)
