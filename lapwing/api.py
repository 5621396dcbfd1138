"""The functions of `import lapwing`."""

from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from os import cpu_count
from pathlib import Path
from typing import Any

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.scene import Overrides, Scene, SceneError
from lapwing.flight import Flight
from lapwing.runs.compile_notice import notify_on_compile
from lapwing.runs.solver import with_solver
from lapwing.runs.work_progress import WorkProgress
from lapwing.services import scene_resolver
from lapwing.services.common.user_code import registered
from lapwing.services.scene_resolver import reseed, resolve
from lapwing.studies import simulate as studied
from lapwing.studies.campaign.distributions import Distribution
from lapwing.studies.campaign.plan import plan


def load_scene(scene: Scene | str | Path, overrides: Overrides = ()) -> Scene:
    """Read a scene and all that it names, override, and validate.

    Args:
        scene: path of its TOML file, or the name of one that ships: "hover"; or a loaded one, to override more of it.
        overrides: values by dotted key, {"effects.random_wind_force.mean": (3.0, 1.0, 0.0)}, or texts "KEY=VALUE"; of
            any key that the scene resolves to, "airframe.rotors.inertia" too. Units: SI.

    Raises:
        SceneError: what is wrong with which key, and what would be right.
    """
    return scene_resolver.load(scene, overrides)


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

    Where a state ceases to be sound, or the controller fails in the air, the flight ends there; its `outcome` says so,
    and `failure` why.

    Args:
        scene: what to fly: a path, a name, or a loaded one.
        overrides: see `load_scene`.
        seed: of all randomness, 0 to 2^63 - 1; None: the scene's.
        controller: one's own in the place of the scene's: a class, an object of one (each take-off begins with a copy
            of it), or "module:Class", as in a scene. It has a `rate` [Hz] and `step(time, estimate, setpoint)`; see
            `lapwing.services.common.controller_api`. A class in a separate module becomes part of the flight's
            set-up, so that
            `lapwing resimulate` can fly a saved log again; one that was typed at a prompt or in a script cannot be.
        controller_options: of the constructor of the class: numbers, texts, lists of numbers, by name.
        estimator: the same of an estimator, with `step(time, readings)`; see `lapwing.services.common.estimator_api`.
        estimator_options: the same.

    Raises:
        SceneError: the scene is invalid, or the controller does not fit it; names the key and the fault.
    """
    given = {"controller": (controller, controller_options), "estimator": (estimator, estimator_options)}
    folder = Path(scene.path if isinstance(scene, Scene) else scene).parent
    with ExitStack() as stack:
        own: dict[str, Any] = {} if seed is None else {"run.seed": seed}
        for key, (thing, options) in given.items():
            if thing is not None:
                own[f"autopilot.{key}"] = stack.enter_context(registered(thing, folder))
            if options:
                own[f"autopilot.{key}_options"] = dict(options)
        chosen = with_solver(scene_resolver.load_one(scene, overrides))
        return _flown_with_bar(resolve(load_scene(chosen, own)))


def read_log(log: str | Path) -> Flight:
    """Return the flight of an MCAP log.

    Raises:
        ValueError: no such file, no MCAP log, or no flight in it.
    """
    return Flight.read(log)


def campaign(
    scene: Scene | str | Path,
    seeds: Iterable[int] = range(1, 101),
    vary: Mapping[str, Distribution] | None = None,
    overrides: Overrides = (),
    *,
    seed: int = 1,
    design: str = "random",
) -> list[Flight]:
    """Fly a scene many times, on all processors; the flights stay in memory. For many, see `lapwing campaign`.

    Args:
        scene: what to fly: a path, a name, or a loaded one.
        seeds: of each run's own randomness; as many runs as there are.
        vary: how keys of the scene vary from run to run: {"vehicle.mass": lapwing.normal(10.4, 0.2)}.
        overrides: see `load_scene`.
        seed: of the campaign. What a run draws depends on this, on its number and on the key alone.
        design: how the runs fill the space of what varies: "random", "lhs", "sobol" or "grid".

    Returns:
        A flight for each run, in their order; with the seeds 1 to n and this `seed` = 1, those of
        `lapwing campaign --runs n`.

    Raises:
        SceneError: the scene is invalid, or a drawn value does not fit it.
        ValueError: an argument is out of its range.
    """
    base = scene_resolver.load_one(scene, overrides)
    for key, distribution in (vary or {}).items():
        if not isinstance(distribution, Distribution):
            raise SceneError(key, f"got {distribution!r}", "a distribution, for example lapwing.normal(10.4, 0.2)")
    seeds = list(seeds)
    if not seeds:
        raise SceneError("seeds", "there are none", "at least one")
    drawn = plan(base.name, (), len(seeds), seed, vary, design=design)
    fixed = None if drawn.keys else resolve(base)

    def setup(run: int) -> RunConfig:
        if fixed is not None:
            return reseed(fixed, seeds[run])
        return resolve(load_scene(base, {**drawn.values(run), "run.seed": seeds[run]}))

    def one(run: int) -> Flight:
        return _flown(setup(run))

    with WorkProgress(f"campaign {base.name}", len(seeds), "flights") as bar:
        first = setup(0)
        with notify_on_compile(first, bar.compiling, alone=False):
            flights = [_flown(first)]  # alone: it compiles
        bar.show(1)
        with ThreadPoolExecutor(cpu_count()) as pool:
            for flight in pool.map(one, range(1, len(seeds))):
                flights.append(flight)
                bar.show(len(flights))
    return flights


def _flown(setup: RunConfig) -> Flight:
    return studied.fly(setup, kind=Flight)


def _flown_with_bar(setup: RunConfig) -> Flight:
    """Fly with a progress bar, if it takes long and somebody looks."""
    with (
        WorkProgress(setup.scene, setup.last_tick * setup.interval, "s") as bar,
        notify_on_compile(setup, bar.compiling, alone=False) as compiling,
    ):

        def observe(tick: int) -> None:
            compiling.ended()
            bar.show(tick * setup.interval)

        return studied.fly(setup, kind=Flight, observe=observe)
