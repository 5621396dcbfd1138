"""Verdict of a validation: signals predicted better or worse than by the baselines, and uses of the model."""

from typing import NamedTuple

import numpy as np

from lapwing.studies.validation.prediction_metrics import BLOCK, FEWEST_CLUSTERS, FEWEST_FLIGHTS, FIELDS, Metric
from lapwing.studies.validation.procedure import Validation

BETTER, WORSE, OPEN = "better", "worse", "unclear"
SMALL = 0.25  # error over that of constant velocity below which the linear fit need not be beaten
SMALLEST = 1e-300  # error of a signal that never changes
HIDDEN = 0.8  # share of an error caused by noise above which it is no evidence against the plant


class Comparison(NamedTuple):
    """Error of the plant in one signal at one horizon, compared with the baselines."""

    field: str
    time: float  # [s] after the start of the window
    ratios: dict[str, Metric]  # over the error of each baseline
    noise: float  # share of the error that the noise of the measurements alone causes

    def outcome(self, baseline: str) -> str:
        """Return the result at 95 % confidence."""
        ratio = self.ratios[baseline]
        return BETTER if ratio.high < 1.0 else WORSE if ratio.low > 1.0 else OPEN

    @property
    def supports(self) -> str:
        """Evidence for the plant.

        It must beat constant velocity, and the linear fit unless the error is small. The linear fit is hard to beat
        where errors are at the noise of the measurements, since it also reduces this noise.
        """
        if "constant_velocity" not in self.ratios:  # neither moves
            return OPEN
        outcomes = [self.outcome(name) for name in self.ratios]
        if all(outcome == BETTER for outcome in outcomes) or self.ratios["constant_velocity"].high < SMALL:
            return BETTER
        return WORSE if WORSE in outcomes and self.noise < HIDDEN else OPEN


class Use(NamedTuple):
    """Use of a model, with the signals and horizons that matter to it: the response times of the loop."""

    name: str
    fields: tuple[str, ...]
    shortest: float  # [s]
    longest: float  # [s]


USES = (
    Use("position loops", ("position", "velocity"), 0.25, 2.0),
    Use("attitude loops", ("attitude",), 0.05, 0.5),
    Use("rate-loop tuning", ("rate",), 0.02, 0.2),
)


def comparisons(validation: Validation) -> list[Comparison]:
    """Return the comparisons of all measured signals by horizon."""
    return [
        Comparison(
            field,
            steps * validation.interval,
            {name: rows[k][f] for name, rows in validation.ratios.items() if np.isfinite(rows[k][f].mean)},
            float(validation.noise[k, f] / max(validation.plant[k][f].mean, SMALLEST)),
        )
        for k, steps in enumerate(validation.horizons)
        for f, field in enumerate(FIELDS)
        if np.isfinite(validation.plant[k][f].mean)
    ]


def uses(validation: Validation) -> dict[str, str]:
    """Return BETTER, WORSE or OPEN for each use, "" for one whose signals or horizons are not compared."""
    rows, result = comparisons(validation), {}
    for use in USES:
        own = [r.supports for r in rows if r.field in use.fields and use.shortest <= r.time <= use.longest + 1e-9]
        result[use.name] = next((s for s in (WORSE, OPEN, BETTER) if s in own), "")
    return result


def sentence(validation: Validation) -> str:
    """Return a sentence on the uses of the model, which follows from the comparisons."""
    result = uses(validation)
    names = {outcome: [name for name in result if result[name] == outcome] for outcome in (BETTER, WORSE, OPEN, "")}
    parts = [f"good enough for {_listed(names[BETTER], 'and')}"] if names[BETTER] else []
    if names[WORSE]:
        parts.append(f"not {'' if parts else 'good enough '}for {_listed(names[WORSE], 'or')}")
    if names[OPEN]:
        parts.append(f"{'not shown for' if parts else 'these flights do not decide on'} {_listed(names[OPEN], 'or')}")
    if names[""]:
        parts.append(f"not tested for {_listed(names[''], 'or')}")
    return ", ".join(parts)


def facts(validation: Validation) -> list[str]:
    """Return lines on the signals and horizons at which the plant is better or worse than each baseline."""
    rows, lines = comparisons(validation), []
    for name in validation.ratios:
        for outcome, text in ((BETTER, "better than"), (WORSE, "worse than"), (OPEN, "neither better nor worse than")):
            found = [row for row in rows if name in row.ratios and row.outcome(name) == outcome]
            lines += [f"{text} {name.replace('_', ' ')}: {_named(found)}"] if found else []
    hidden = [row for row in rows if row.noise >= HIDDEN]
    return lines + ([f"at the noise of the measurements: {_named(hidden)}"] if hidden else [])


def _named(rows: list[Comparison]) -> str:
    times: dict[str, list[str]] = {}
    for row in rows:
        times.setdefault(row.field.replace("_", " "), []).append(f"{row.time:.3g}")
    return "; ".join(f"{field} after {_listed(each, 'and')} s" for field, each in times.items())


def basis(validation: Validation) -> str:
    """Return a text on what the intervals cover."""
    if validation.clusters < FEWEST_CLUSTERS:
        return f"no intervals: they need {FEWEST_CLUSTERS * BLOCK:g} s of flight"
    if len(validation.flights) < FEWEST_FLIGHTS:
        return (
            f"95 % intervals for flights like these, over blocks of {BLOCK:g} s (over flights from {FEWEST_FLIGHTS} on)"
        )
    return f"95 % intervals over {len(validation.flights)} flights"


def as_json(validation: Validation) -> dict:
    """Return the verdict as plain data."""
    return {
        "text": sentence(validation),
        "uses": {name: outcome or None for name, outcome in uses(validation).items()},
        "intervals": basis(validation),
        "comparisons": [
            {
                "signal": row.field,
                "time": row.time,
                "noise": row.noise,
                "baselines": {
                    name: {"ratio": m.mean, "confidence_95": [m.low, m.high], "plant_is": row.outcome(name)}
                    for name, m in row.ratios.items()
                },
            }
            for row in comparisons(validation)
        ],
    }


def _listed(words: list[str], conjunction: str) -> str:
    return f" {conjunction} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
