"""The functions of `import lapwing`."""

from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from os import cpu_count
from pathlib import Path

import numpy as np

from cosim.scene import Overrides, Scene
from cosim.setup import Setup
from lapwing.distributions import Distribution
from lapwing.flight import Flight
from services import table
from services.table import reseed, resolve
from studies import fly as studied


def load(scene: str | Path, overrides: Overrides = ()) -> Scene:
    """Read a scene and all that it names, override, and validate.

    Args:
        scene: path of its TOML file, or the name of one that ships: "hover".
        overrides: values by dotted key, {"effects.wind_random.mean": (3.0, 1.0, 0.0)}, or texts "KEY=VALUE"; of any key
            that the scene resolves to, "airframe.mass.total" too.

    Raises:
        SceneError: what is wrong with which key, and what would be right.
    """
    return table.load(scene, overrides)


def fly(scene: Scene | str | Path, overrides: Overrides = (), seed: int | None = None) -> Flight:
    """Fly a scene in this process, as fast as it goes; the flight stays in memory.

    Args:
        scene: what to fly.
        overrides: as of `load`; only where `scene` is a path or a name.
        seed: of all randomness; None: the scene's.

    Raises:
        SceneError: the scene is not sound.
        ValueError: overrides for a scene that is loaded already.
    """
    return _flown(_setup(scene, overrides, seed))


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
    """Fly a scene many times, on all processors; a flight for each seed.

    Args:
        scene: what to fly: a path or a name where anything is varied.
        seeds: of the randomness of each flight, and of what is varied in it.
        vary: how keys of the scene vary from flight to flight: {"airframe.mass.total": lapwing.normal(10.4, 0.2)}.
        overrides: as of `load`.

    Raises:
        SceneError: the scene is not sound, or what was drawn does not fit it.
        ValueError: a loaded scene cannot be varied.
    """
    if vary and isinstance(scene, Scene):
        raise ValueError("campaign: expected a path or a name of a scene whose keys are to be varied")
    fixed = None if vary else _setup(scene, overrides, None)

    def setup(seed: int) -> Setup:
        if fixed is not None:
            return reseed(fixed, seed)
        generator = np.random.default_rng(seed)
        drawn = {key: distribution(generator) for key, distribution in (vary or {}).items()}
        given = dict(overrides) if isinstance(overrides, Mapping) else dict(o.split("=", 1) for o in overrides)
        return resolve(load(scene, {**given, **drawn, "run.seed": seed}))  # type: ignore[arg-type]

    chosen = list(seeds)
    first = [_flown(setup(seed)) for seed in chosen[:1]]  # alone: it compiles
    with ThreadPoolExecutor(cpu_count()) as pool:
        return first + list(pool.map(lambda seed: _flown(setup(seed)), chosen[1:]))


def _setup(scene: Scene | str | Path, overrides: Overrides, seed: int | None) -> Setup:
    if not isinstance(scene, Scene):
        scene = load(scene, overrides)
    elif overrides:
        raise ValueError("overrides: expected with the path or the name of a scene; load() it with them instead")
    setup = resolve(scene)
    return setup if seed is None else reseed(setup, seed)


def _flown(setup: Setup) -> Flight:
    return studied.fly(setup, kind=Flight)
