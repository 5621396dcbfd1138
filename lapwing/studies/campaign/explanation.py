"""Smallest form of a failed run: the least change of the varied parameters that still fails."""

import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from lapwing.cosim.scene.toml_text import toml
from lapwing.studies.campaign.folder import read
from lapwing.studies.campaign.plan import SEED, Plan
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.runs import Row, row_of, scene_of
from lapwing.studies.campaign.single_run import plan_of, recorded_row
from lapwing.studies.campaign.verdict import drivers, subject, unmet

HALVINGS = 7  # of the interval between the value of the scene and the drawn one


class Change(NamedTuple):
    """A parameter without whose change the run succeeds."""

    key: str
    nominal: Any  # value of the scene; None if the scene has none
    drawn: Any
    least: Any  # nearest value to the nominal one that fails
    passes: Any  # nearest value that succeeds; None for a value that is not a decimal number


class Explanation(NamedTuple):
    """Result of `explain`."""

    run: int
    outcome: str  # of the run
    criteria: tuple[str, ...]  # that it does not meet
    changes: tuple[Change, ...]
    unneeded: tuple[str, ...]  # parameters with which the run fails also at the value of the scene
    least_outcome: str  # with the least changes
    flights: int
    command: str  # flies the run with the least changes


def _silent(text: str, done: int, total: int) -> None:
    pass


def explain(folder: Path, run: int, progress: Callable[[str, int, int], None] = _silent) -> Explanation:
    """Find the least change of the varied parameters with which a run still misses one of its criteria.

    Parameters are set to the value of the scene one by one, those with the weakest influence first, as long as the run
    fails (Zeller and Hildebrandt, "Simplifying and isolating failure-inducing input", 2002). Each remaining decimal
    number is then moved towards the value of the scene by bisection. The seed stays.

    Raises:
        ValueError: the run does not exist or does not fail, or the scene differs from the campaign's.
    """
    campaign = read(folder)
    plan = plan_of(Path(campaign.plan.path), run, folder)
    texts = campaign.about["success"]
    flown: dict[str, Row] = {}
    most = 2 + len(plan.keys) * (3 + HALVINGS)

    def fly(values: Mapping[str, Any]) -> Row:
        if (key := repr(sorted(values.items()))) not in flown:
            progress(f"flying with {len(values)} of {len(plan.keys)} drawn values", len(flown) + 1, most)
            flown[key] = row_of(plan, run, values=values)
        return flown[key]

    kept = plan.values(run)
    outcome = (recorded_row(run, folder) or fly(kept))["outcome_text"]
    if not (missed := unmet(texts, outcome)):
        raise ValueError(f"--explain {run}: {outcome or 'the run succeeds'}; expected a failed run")

    def fails(values: Mapping[str, Any]) -> bool:
        return not set(missed).isdisjoint(unmet(texts, fly(values)["outcome_text"]))

    results = Results(campaign)
    strongest = [driver.key for driver in drivers(results, subject(results))]
    order = sorted(kept, key=lambda key: -strongest.index(key) if key in strongest else -len(kept))
    shrinks = True
    while shrinks:  # a parameter may have become unneeded without another one
        shrinks = False
        for key in [key for key in order if key in kept]:
            others = {name: value for name, value in kept.items() if name != key}
            if fails(others):
                kept, shrinks = others, True
    changes = []
    for key, drawn in list(kept.items()):
        nominal, passes = _nominal(plan, key), None
        if isinstance(drawn, float) and isinstance(nominal, int | float) and not fails({**kept, key: float(nominal)}):

            def fails_at(value: float, key: str = key) -> bool:
                return fails({**kept, key: value})

            kept[key], passes = least_failing(fails_at, float(nominal), drawn)
        changes.append(Change(key, nominal, drawn, kept[key], passes))
    overrides = [
        *plan.overrides,
        f"{SEED}={plan.seed_of(run)}",
        *(f"{key}={toml(value)}" for key, value in kept.items()),
    ]
    sets = [part for text in overrides for part in ("--set", text)]
    return Explanation(
        run, outcome, tuple(missed), tuple(changes),
        tuple(key for key in plan.keys if key not in kept), fly(kept)["outcome_text"], len(flown),
        shlex.join(["lapwing", "run", plan.path, *sets]),
    )  # fmt: skip


def least_failing(fails: Callable[[float], bool], passes: float, drawn: float) -> tuple[float, float]:
    """Return the nearest value to `passes` that fails, rounded if that fails too, and the nearest to it that passes.

    `drawn` fails; without the rounding, the distance of both results is 2^-`HALVINGS` of the interval.
    """
    least = drawn
    for _ in range(HALVINGS):
        middle = 0.5 * (least + passes)
        if fails(middle):
            least = middle
        else:
            passes = middle
    rounded = float(f"{least:.4g}")
    return (rounded if rounded == least or fails(rounded) else least), passes


def _nominal(plan: Plan, key: str) -> Any:
    """Return the value of a key in the scene, otherwise the median of its distribution; None without both."""
    node: Any = scene_of(plan).resolved
    for part in key.split("."):
        if isinstance(node, list) and part.isdigit() and int(part) < len(node):
            node = node[int(part)]
        else:
            node = node.get(part) if isinstance(node, dict) else None
    if node is None:
        node = next((d.at(0.5) for name, d in plan.vary if name == key and not d.values), None)
    return node if isinstance(node, str | int | float) else None
