"""Flights of the runs of a campaign, called by all workers: from the run's number to its row of the table."""

import contextlib
import hashlib
import math
import platform
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import lapwing.services
from lapwing.cosim.config.provenance import package_version
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.scene import Scene, SceneError
from lapwing.flights.metrics import METRICS, check_success, joint_end_state, metrics
from lapwing.services.common.schemas.success_criteria import Success
from lapwing.services.common.schemas.vehicle_schema import Vehicle
from lapwing.services.process_table import foreign_firmware
from lapwing.services.scene_resolver import load, reseed
from lapwing.studies.campaign import fleet_columns
from lapwing.studies.campaign.campaign_config import TOPICS, campaign_config
from lapwing.studies.campaign.plan import SEED, Plan
from lapwing.studies.simulate import fly_each

REJECTED = "rejected"  # outcome of a run with values that the scene rejects
TRIAL_RUNS = 16  # number of first runs, and of runs spread over the campaign, one of which must be valid
_ABSOLUTE_FOLDER = re.compile(r"(?<![^\s'\"(])/(?:[^\s/]+/)+")  # folder of an absolute path
_PACKAGES = ("lapwing",)
_LIBRARIES = ("llvmlite", "numba", "numpy", "scipy")

Row = dict[str, Any]  # values by column


class Reference(NamedTuple):
    """Versions and end state that every worker must reproduce."""

    versions: dict[str, str]
    run: int
    end_state: str  # of this run


@cache
def versions() -> dict[str, str]:
    """Return the versions that affect the results of a flight."""
    folder, digest = Path(lapwing.services.__file__).parents[1], hashlib.blake2b(digest_size=8)
    for path in sorted(path for name in _PACKAGES for path in (folder / name).rglob("*.py")):
        digest.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    result = {"lapwing": package_version(), "sources": digest.hexdigest(), "python": platform.python_version()}
    return result | {name: version(name) for name in _LIBRARIES}


def vehicles(plan: Plan) -> tuple[str, ...]:
    """Return the vehicle names of a fleet; () for a single vehicle."""
    return tuple(vehicle[Vehicle].name for vehicle in scene_of(plan).vehicles)


def columns(plan: Plan, vehicles: Sequence[str]) -> dict[str, type]:
    """Return the name and type of every column of the table; `vehicles` of a fleet."""
    result: dict[str, type] = {"run": int, "seed": int}
    for key in plan.keys:
        drawn = next((d for k, d in plan.vary if k == key), None)
        values = [entry[key] for entry in plan.sweep if key in entry] if drawn is None else drawn.values
        result[key] = float if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values) else str
    result |= {"success": bool, **{name: str if name in ("outcome", "outcome_text") else float for name in METRICS}}
    return {**result, **fleet_columns.columns(tuple(vehicles)), "end_state": str}


def first_config(plan: Plan) -> tuple[int, RunConfig]:
    """Return the number and run configuration of the first run that the scene accepts.

    Raises:
        SceneError: the scene is invalid, or rejects the first `TRIAL_RUNS` runs and as many others.
    """
    first_error = None
    spread_runs = np.linspace(0, plan.runs - 1, TRIAL_RUNS, dtype=int).tolist()  # the first runs of a grid are similar
    for run in dict.fromkeys([*range(min(plan.runs, TRIAL_RUNS)), *spread_runs]):
        try:
            return run, config_of(plan, run)
        except SceneError as error:
            first_error = first_error or error
    assert first_error is not None
    raise first_error


def reference(run: int, config: RunConfig) -> Reference:
    """Fly a run and return the reference; without an end state for a foreign firmware, whose flights differ."""
    if foreign_firmware(config):
        return Reference(versions(), run, "")
    return Reference(versions(), run, joint_end_state(fly_each(config, TOPICS)))


def fly_runs(plan: Plan, reference: Reference, start: int, stop: int) -> list[Row]:
    """Return the rows of the runs from `start` (inclusive) to `stop` (exclusive).

    Raises:
        ValueError: this worker has other versions or different results.
    """
    _check(plan, reference)
    rows: dict[str, np.ndarray] = {}
    return [row_of(plan, run, rows) for run in range(start, stop)]


def row_of(
    plan: Plan, run: int, rows: dict[str, np.ndarray] | None = None, values: Mapping[str, Any] | None = None
) -> Row:
    """Fly a run. Return its row; a run that the scene rejects has that as its outcome.

    Args:
        plan: plan of the campaign.
        run: number of the run.
        rows: reusable memory for the flights of successive runs.
        values: values by key instead of the drawn ones.
    """
    drawn = plan.values(run) if values is None else values
    row: Row = {"run": run, "seed": plan.seed_of(run), **drawn, "success": False}
    try:
        config = config_of(plan, run, drawn)
    except SceneError as error:
        return {**row, **_rejected_row(vehicles(plan)), "outcome_text": _rejection_text(error)}
    flights = fly_each(config, TOPICS, rows)
    row["end_state"] = joint_end_state(flights)
    scene = scene_of(plan)
    if scene.vehicles:
        by_name = {flight.vehicle: flight for flight in flights}
        required = {vehicle[Vehicle].name: vehicle[Success] for vehicle in scene.vehicles}
        return row | fleet_columns.joint_row(
            by_name, {name: metrics(flight) for name, flight in by_name.items()}, required
        )
    result = metrics(flights[0])
    unmet = scene[Success].unmet(result)
    text = f"{result['outcome_text']}; not {', not '.join(unmet)}" if unmet else ""
    return {**row, **result, "success": not unmet, "outcome_text": text}


def _rejection_text(error: SceneError) -> str:
    """Return the error text without folders, so that the table is equal for all workers."""
    source = error.source
    if source.path is not None:
        source = source._replace(path=Path(source.path.name))
    return _ABSOLUTE_FOLDER.sub("", str(SceneError(error.key, error.message, error.expected, source)))


def _rejected_row(names: tuple[str, ...]) -> Row:
    result: Row = dict.fromkeys(METRICS, math.nan)
    for name, kind in fleet_columns.columns(names).items():
        result[name] = {bool: False, str: REJECTED, float: math.nan}[kind]
    return {**result, "outcome": REJECTED, "end_state": ""}


def config_of(plan: Plan, run: int, values: Mapping[str, Any] | None = None) -> RunConfig:
    """Return the run configuration of a run, with the drawn values or those of `values`.

    Raises:
        SceneError: the values do not fit the scene.
    """
    drawn = plan.values(run) if values is None else values
    if not drawn:
        return reseed(_resolve(plan.path, plan.overrides), plan.seed_of(run))
    with name_option_in_errors(plan):
        return campaign_config(load(scene_of(plan), {**drawn, SEED: plan.seed_of(run)}))


@contextlib.contextmanager
def name_option_in_errors(plan: Plan) -> Iterator[None]:
    """Name the option that varies a key in errors about its value."""
    try:
        yield
    except SceneError as error:
        named = error.with_option(lambda key: f"--{argument}" if (argument := plan.argument(key)) else "")
        raise named from error.__cause__


def scene_of(plan: Plan) -> Scene:
    """Return the scene of a campaign."""
    return _scene(plan.path, plan.overrides)


def sources(plan: Plan) -> dict[str, str]:
    """Return the source texts of a campaign: the scene, its files, and files that runs may name instead.

    Raises:
        ValueError: a value of a varied key is itself wrong, such as the name of a file that does not exist.
    """
    result = {name: text.decode() for name, text in scene_of(plan).sources.items()}
    for key, distribution in plan.vary:
        for value in distribution.values:
            if isinstance(value, str):
                try:
                    sources_of_value = load(scene_of(plan), {key: value}).sources
                except SceneError as error:
                    if error.key == key:
                        raise ValueError(str(error).replace("override", "--vary", 1)) from None
                    continue  # another varied key may make it valid; if not, the run is rejected
                texts = {name: text.decode() for name, text in sources_of_value.items()}
                result |= {f"{key}={value}: {n}": t for n, t in texts.items() if result.get(n) != t}
    return dict(sorted(result.items()))


@cache
def _scene(scene: str, overrides: tuple[str, ...]) -> Scene:
    result = load(scene, overrides)
    for vehicle in result.vehicles or (result,):
        check_success(vehicle)
    return result


@cache
def _resolve(scene: str, overrides: tuple[str, ...]) -> RunConfig:
    return campaign_config(_scene(scene, overrides))


_verified_end_states: set[str] = set()  # end states that this process has reproduced


def _check(plan: Plan, reference: Reference) -> None:
    """Check that this worker reproduces the reference of the campaign."""
    worker = f"worker on {platform.node()}"
    try:
        scene_of(plan)
    except SceneError as error:
        raise ValueError(f"{worker}: {error}") from None
    for name, expected in reference.versions.items():
        if (result := versions().get(name)) != expected:
            raise ValueError(f"{worker}: has {name} {result}; expected {expected} as at the start of the campaign")
    if foreign_firmware(config_of(plan, reference.run)):
        return  # one that the user has started is not repeatable
    if reference.end_state not in _verified_end_states:
        if (result := joint_end_state(fly_each(config_of(plan, reference.run), TOPICS))) != reference.end_state:
            raise ValueError(
                f"{worker}: the end state of run {reference.run} differs from that at the start of the campaign"
            )
        _verified_end_states.add(reference.end_state)
