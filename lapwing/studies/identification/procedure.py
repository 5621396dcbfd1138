"""Identification of a scene's plant from flights: estimation, test on held-out flights, airframe file."""

import hashlib
import json
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.cosim.complete_file import write_text
from lapwing.cosim.scene import Overrides, Scene
from lapwing.cosim.scene.toml_text import dump
from lapwing.dynamics.config_error import did_you_mean
from lapwing.flights.log_import.recording import Recording
from lapwing.services.common.schemas.vehicle_schema import VehicleAirframe
from lapwing.services.scene_resolver import load_one
from lapwing.studies.campaign import posterior
from lapwing.studies.campaign.distributions import lognormal, normal
from lapwing.studies.identification.flight_parameters import KEYS, apply_flight_parameters, is_flight_parameter
from lapwing.studies.identification.output_error import FIELDS, HORIZONS, Fit, OutputError
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.procedure import (
    STRIDE,
    Validation,
    compare_with_flights,
    on_rotors,
    plant_of,
    read_flights,
    with_windows,
)
from lapwing.studies.validation.start_states import (
    TrimMemory,
    trim_memory,
    unknown_parameters,
    unmeasured_motion,
    with_made_up_motion,
)

HELD_OUT = 0.2  # share of the flights that are not used for estimation
VAGUE = 0.5  # standard error over value above which a positive parameter is not drawn
TEST_TIMES = (0.01, 0.1, 0.5)  # [s] after which held-out flights are compared


@dataclass(frozen=True)
class Identification:
    """Estimated parameters and their prediction errors."""

    scene: str
    fit: Fit
    used: tuple[str, ...]  # names of the flights used for estimation
    held_out: tuple[str, ...]  # names of the flights used for the test
    skipped: tuple[str, ...]  # a line for each excluded flight
    before: Validation  # of the initial values on the held-out flights, or those used if there are none
    after: Validation
    unknown: tuple[str, ...] = ()  # what flights without positions do not determine, a line each


def identify(
    scene: Scene | str | Path,
    paths: Sequence[Path],
    mapping: str | None,
    keys: Sequence[str],
    memory: TrimMemory,
    overrides: Overrides = (),
    windows: int = 1000,
    seed: int = 1,
    progress: Path | None = None,
    report: Callable[[str, int, int], None] = lambda text, done, total: None,
    most: int = 15,
    horizons: tuple[int, ...] = HORIZONS,
) -> Identification:
    """Estimate the free parameters.

    Args:
        scene: scene with the plant and the initial values.
        paths: files of flights with the same rate.
        mapping: mapping of raw files.
        keys: numbers of the scene, or keys of `flight_parameters`.
        memory: time constants of the trim.
        overrides: overrides of the scene.
        windows: approximate number of windows.
        seed: seed of the selection of held-out flights.
        progress: file for the values after each step, from which an interrupted estimation continues.
        report: called with a description of the progress, the number of finished steps, and its maximum.
        most: maximum number of steps.
        horizons: samples after which errors count.

    Raises:
        ValueError: a flight or key is invalid, or no flight leaves the ground.
    """
    base = load_one(scene, overrides)
    start = [start_value(base, key) for key in keys]
    recordings, skipped = read_flights(paths, mapping, report)
    recordings = on_rotors(base, recordings)
    test_horizons = tuple(sorted({max(1, round(time / recordings[0].interval)) for time in TEST_TIMES}))
    missing = unmeasured_motion(recordings)
    fields = tuple(f for f in FIELDS if f not in missing) + (("specific_force",) if missing else ())
    unknown, memory = unknown_parameters(recordings, missing), trim_memory(memory, missing)
    recordings = [with_made_up_motion(r, missing) for r in recordings]
    flights, unused = with_windows(recordings, max(horizons[-1], test_horizons[-1]))
    test_indices = _held_out(len(flights), seed)
    used = [r for k, r in enumerate(flights) if k not in test_indices]
    held_out = [r for k, r in enumerate(flights) if k in test_indices]
    plant = plant_of(base, flights)
    problem = OutputError(plant, used, keys, start, windows, memory, horizons, fields)
    stamp = _stamp(base, keys, [r.name for r in used], windows, seed, (memory, horizons))
    begin = _read_progress(progress, stamp)

    def store(step: int, values: np.ndarray, cost: float) -> None:
        report(f"loss {cost:.4g}", step, most)
        if progress:
            write_text(progress, json.dumps({"stamp": stamp, "values": values.tolist()}))

    fit = problem.solve(begin, most, store)
    name = str(getattr(base, "name", scene))
    before, after = (
        _test(name, plant, (held_out, used), keys, values, test_horizons, memory, missing)
        for values in (np.array(start), fit.values)
    )
    if progress:
        progress.unlink(missing_ok=True)
    names, test_names = tuple(r.name for r in used), tuple(r.name for r in held_out)
    return Identification(name, fit, names, test_names, (*skipped, *unused), before, after, unknown)


def write_airframe(
    path: Path, scene: Scene | str | Path, identification: Identification, overrides: Overrides = ()
) -> None:
    """Write the scene's airframe with the estimated values, those of effects as comments, and their posterior."""
    base = load_one(scene, overrides)
    table = base[VehicleAirframe].model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    table |= {"mass": base[VehicleAirframe].mass.model_dump(mode="json")}
    values = {k: float(v) for k, v in zip(identification.fit.keys, identification.fit.values, strict=True)}
    others = {}
    for key, value in values.items():
        first, _, rest = key.partition(".")
        if first == "airframe":
            _put(table, rest.split("."), value)
        elif not is_flight_parameter(key):
            others[key] = value
    lines = [
        f"# Identified by output error from {len(identification.used)} flights: {', '.join(identification.used)}.",
        f"# Held out: {', '.join(identification.held_out) or 'none'}.",
    ]
    for key, value, error in zip(
        identification.fit.keys, identification.fit.values, identification.fit.standard_errors, strict=True
    ):
        state = ", not determined by the flights" if key in identification.fit.undetermined else ""
        lines.append(f"# {key} = {value:.6g}, standard error {error:.2g}{state}")
    if others:
        lines.append("# For the scene, in addition to vehicle.airframe:")
        lines += [f"#   {key} = {value:.9g}" for key, value in others.items()]
    text = "\n".join(lines) + "\n\n" + dump(table | joint_distribution(identification.fit))
    tomllib.loads(text)
    write_text(path, text)


def joint_distribution(fit: Fit) -> dict[str, Any]:
    """Return the table with the posterior of the parameters of the scene, empty if the flights determine none.

    Parameters of recordings are left out, those without influence, and positive ones whose standard errors exceed half
    their values: the linearisation about the estimate does not hold so far from it.
    """
    limit = np.where(fit.start > 0.0, VAGUE * np.abs(fit.values), np.inf)
    own = [k for k, key in enumerate(fit.keys) if not is_flight_parameter(key) and fit.standard_errors[k] < limit[k]]
    if not own:
        return {}
    kinds = {fit.keys[k]: lognormal.__name__ if fit.start[k] > 0.0 else normal.__name__ for k in own}
    errors = fit.standard_errors[own]
    covariance = fit.correlations[np.ix_(own, own)] * np.outer(errors, errors)
    return {posterior.TABLE: posterior.table(kinds, fit.values[own], covariance)}


def start_value(scene: Scene, key: str) -> float:
    """Return the value of a key in the scene.

    Raises:
        ValueError: no such key, or not a number.
    """
    if is_flight_parameter(key):
        return 0.0
    table, _, rest = key.partition(".")
    value: Any = None
    try:
        if table == "effects":
            value = scene.section(table).tables
            for part in rest.split("."):
                value = value[int(part)] if isinstance(value, list | tuple) else value[part]
        else:
            prefix, _, element = key.rpartition(".")
            value = scene.lookup(prefix)[int(element)] if element.isdigit() else scene.lookup(key)
    except (KeyError, IndexError, AttributeError, TypeError, ValueError):
        value = None
    if isinstance(value, bool) or not isinstance(value, int | float):
        hint = (
            did_you_mean(key, [*_number_keys(scene.resolved), *KEYS]) or "; use a key that the scene or airframe sets"
        )
        raise ValueError(f"--free {key}: no number of this name in the scene{hint}")
    return float(value)


def _number_keys(tables: Mapping[str, Any]) -> Iterator[str]:
    """Yield the dotted keys of the numbers of airframe and effects."""
    nodes = [(name, tables[name]) for name in ("airframe", "effects") if name in tables]
    while nodes:
        key, value = nodes.pop()
        if isinstance(value, dict | list):
            items = value.items() if isinstance(value, dict) else enumerate(value)
            nodes += [(f"{key}.{name}", item) for name, item in items]
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield key


def _held_out(count: int, seed: int) -> set[int]:
    size = round(HELD_OUT * count) if count > 2 else 0
    return set(np.random.default_rng(seed).permutation(count)[:size].tolist())


def _stamp(scene: Scene, keys: Sequence[str], flights: list[str], windows: int, seed: int, other: Any) -> str:
    parts = [*(f"{k}={start_value(scene, k)!r}" for k in keys), *flights, str(windows), str(seed), repr(other)]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def _read_progress(progress: Path | None, stamp: str) -> np.ndarray | None:
    if progress is None or not progress.exists():
        return None
    try:
        content = json.loads(progress.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return np.array(content["values"], float) if content.get("stamp") == stamp else None


def _test(
    name: str,
    plant: PlantRows,
    flights: tuple[list[Recording], list[Recording]],
    keys: Sequence[str],
    values: np.ndarray,
    horizons: tuple[int, ...],
    memory: TrimMemory,
    missing: tuple[str, ...],
) -> Validation:
    """Compare the plant of these values with the first of two groups of flights, or the second if that is empty."""
    own = {k: float(v) for k, v in zip(keys, values, strict=True)}
    plant.set_parameters([{k: v for k, v in own.items() if not is_flight_parameter(k)}])
    of_flights = {k: v for k, v in own.items() if is_flight_parameter(k)}
    test, others = ([apply_flight_parameters(f, of_flights) for f in group] for group in flights)
    if not test:
        test, others = others, test
    return compare_with_flights(name, plant, test, horizons, memory, STRIDE, others=others, unmeasured=missing)


def _put(table: Any, keys: list[str], value: float) -> None:
    for key in keys[:-1]:
        table = table[int(key)] if isinstance(table, list) else table[key]
    if isinstance(table, list):
        table[int(keys[-1])] = value
    else:
        table[keys[-1]] = value
