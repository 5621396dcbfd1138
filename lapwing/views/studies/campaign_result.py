"""Result of a campaign, of the comparison of two, and of the explanation of a failed run."""

import math
import shlex
from functools import partial
from textwrap import wrap

import numpy as np

from lapwing.flights.consistency import JOINT, SOURCES, bounds
from lapwing.flights.tracking import AXES, digits, unit_and_factor
from lapwing.studies.campaign.comparison import Comparison
from lapwing.studies.campaign.explanation import Explanation
from lapwing.studies.campaign.fleet_columns import NEAREST
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.statistics import Interval, percent
from lapwing.studies.campaign.verdict import criteria, drivers, subject, verdict
from lapwing.views.studies import campaign_plots
from lapwing.views.studies.campaign_plots import label_and_factor
from lapwing.views.studies.study_result import Rows, StudyResult

VEHICLE_COLUMNS = {
    "rmse.x": "x [m]", "rmse.y": "y [m]", "rmse.z": "z [m]", "max_distance": "farthest [m]",
    "touchdown.speed": "touchdown [m/s]",
}  # fmt: skip
WORST = ("max_distance", "touchdown.speed", "max_tilt")  # metrics of the worst runs
LISTED = 10  # worst runs, and rejected runs
BAR = 20  # characters of a bar
PLOTS = {
    "Criteria": campaign_plots.criteria_plot,
    "Errors": campaign_plots.errors,
    "Probability of success": campaign_plots.success,
    "Touchdown": campaign_plots.touchdown,
    "Sensitivities": campaign_plots.sensitivity,
    "Other metrics": campaign_plots.others,
}


def result(results: Results, digest: str = "") -> StudyResult:
    """Return the result of a campaign whose table has this digest."""
    rejected = results.rejected
    runs_in_all = len(results) + len(rejected["run"])
    runs = zip(rejected["run"], rejected["outcome_text"], strict=True)
    notes = [f"rejected: run {run}: {text}" for run, text in list(runs)[:LISTED]]
    if len(rejected["run"]):
        text = "; they count neither as success nor as failure"
        notes.insert(0, f"The scene rejected the parameters of {len(rejected['run'])} runs{text}")
    if not len(results):
        return StudyResult(results.scene, f"the scene rejected all {runs_in_all} runs", "bad", notes=tuple(notes))
    if len(results) > 1 and not results.figures:
        notes.append("All runs are equal: the scene has no random numbers, and no key varies")
    failed = ~results["success"].astype(bool)
    if failed.any() and (distance := results.spread("target_distance")):
        text = f"median {distance.median:.1f} m, worst {distance.worst:.1f} m (run {distance.run})"
        notes.append(f"Final distance from the mission's target: {text}")
    if results.vehicles:
        least = results.spread(NEAREST)
        text = f"{least.worst:.2f} m (run {least.run}), median {least.median:.2f} m" if least else "unknown"
        notes.append(f"Smallest separation of two vehicles: {text}")
    spreads = {name: spread for name in results.figures if (spread := results.spread(name))}
    metric = subject(results)
    return StudyResult(
        results.scene, verdict(results), "bad" if failed.any() else "warn" if results.lost else "good",
        (results.outcome_text,),
        tuple(_tables(results)),
        {name: partial(draw, results) for name, draw in PLOTS.items()},
        (*notes, *(_estimate_lines(results) if results.on_estimate else ())),
        _facts(results),
        {
            "scene": results.scene,
            "runs": runs_in_all,
            "outcome_text": results.outcome_text,
            "failure": results.failure,
            "criteria": criteria(results),
            "drivers": {metric: drivers(results, metric)},
            "figures": spreads,
            "failed": results["run"][failed],
            "rejected": rejected["run"],
            "digest": digest,
        },
    )  # fmt: skip


def _tables(results: Results) -> list[Rows]:
    tables = [_criteria(results), _errors(results, "ground truth", "rmse")]
    if results.on_estimate:
        tables.append(_errors(results, "estimate", "rmse_estimate"))
    if results.vehicles:
        rows = Rows("Worst run and success rate of each vehicle", "vehicle", *VEHICLE_COLUMNS.values(), "success")
        for vehicle in results.vehicles:
            worst = [results.spread(f"{vehicle}.{name}") for name in VEHICLE_COLUMNS]
            share = f"{100.0 * results[f'{vehicle}.success'].astype(bool).mean():.1f} %"
            rows.add(vehicle, *(digits(s.worst) if s else "" for s in worst), share)
        tables.append(rows)
    return [*tables, *_worst(results)]


def _criteria(results: Results) -> Rows:
    rows = Rows("Criteria of success", "criterion", "failed", "median", "worst", "run", "", texts=("",))
    for row in criteria(results):
        share = row.failures / len(results)
        bar = "█" * max(round(BAR * share), row.failures > 0)
        spread = results.spread(row.metric) if row.metric in results.columns else None  # in the unit of the limit
        numbers = (digits(spread.median), digits(spread.worst), str(spread.run)) if spread else ("",) * 3
        text = "\n".join(wrap(row.text, 30))
        rows.add(text, str(row.failures), *numbers, bar, failed=row.failures > 0)
    return rows


def _errors(results: Results, of: str, kind: str) -> Rows:
    published = kind == "rmse" and results.published
    heads = ("\n".join(wrap(results.source, 10)), "worst /\npublished") if published else ()
    title = f"Root-mean-square error between reference and {of}"
    rows = Rows(title, "axis", "median", "95 % of\nruns below", "worst", "run", *heads)
    for axis in AXES:
        s, (unit, scale) = results.spread(f"{kind}.{axis}"), unit_and_factor(axis)
        if s is None:
            continue
        row = [f"{axis} [{unit}]", *(digits(scale * v) for v in (s.median, s.high, s.worst)), str(s.run)]
        if published:
            value = results.published.get(f"rmse.{axis}")
            row += [digits(scale * value), f"{s.worst / value:.3f}"] if value else ["", ""]
        rows.add(*row)
    return rows


def _worst(results: Results) -> list[Rows]:
    plan, folder = results.folder.plan, results.folder.path
    worst, texts = results.worst(LISTED), ("outcome", "parameters")
    labels = [label_and_factor(name) for name in WORST]
    run = str(worst[0]["run"])
    command = shlex.join(["lapwing", "run", plan.path, "--run", run, "--campaign", str(folder)])
    caption = f"{command} repeats run {run} bit for bit and writes a log."
    if not worst[0]["success"]:
        caption += f" {shlex.join(['lapwing', 'campaign', str(folder), '--explain', run])} finds what it fails by."
    rows = Rows("Worst runs", "run", *texts, *(label for label, _ in labels), caption=caption, texts=texts, only="page")
    for row in worst:
        values = ", ".join(f"{k} {row[k]:.4g}" if isinstance(row[k], float) else f"{k} {row[k]}" for k in plan.keys)
        numbers = (f"{scale * row[name]:.3g}" for name, (_, scale) in zip(WORST, labels, strict=True))
        rows.add(str(row["run"]), row["outcome_text"] or row["outcome"], values, *numbers)
    listed = Rows("Failed runs", "run", "outcome", texts=("outcome",), only="console")
    for row in worst:
        if not row["success"]:
            listed.add(str(row["run"]), "\n".join(wrap(row["outcome_text"], 70)))
    return [rows, listed]


def _estimate_lines(results: Results) -> list[str]:
    """Return lines on the estimate: share within 3 sigma, joint NEES and NIS over all runs with their 95 % bounds."""
    lines = []
    least = {axis: results.spread(f"within_3sigma.{axis}") for axis in "xyz"}
    if text := ", ".join(f"{axis} {100.0 * s.worst:.1f} % (run {s.run})" for axis, s in least.items() if s):
        shares = ", ".join(f"{axis} {100.0 * results[f'within_3sigma.{axis}'].mean():.2f} %" for axis in "xyz")
        lines.append(f"Ground truth within 3 sigma of the estimate: {shares} of the time; lowest of a flight: {text}")
    finite = results["nees"][np.isfinite(results["nees"])]
    if not len(finite):
        return lines
    low, high = bounds(JOINT, len(finite))
    share = np.nanmean(results["within_95.nees"])
    samples = int(np.nansum(results["nis_samples"]))
    innovations = []
    for source, (_, dimension) in SOURCES.items():
        if np.isfinite(results[f"nis.{source}"]).any():
            lowest, highest = (bound / dimension for bound in bounds(dimension, samples))
            innovations.append(f"{source} {np.nanmean(results[f'nis.{source}']):.3f} ({lowest:.3f} to {highest:.3f})")
    return [
        *lines,
        f"Joint NEES of attitude, velocity, position: {finite.mean():.2f}, expected {JOINT}, 95 % bounds {low:.2f} to "
        f"{high:.2f}; within its 95 % quantile {100.0 * share:.1f} % of the time",
        f"NIS by dimension, expected 1 (95 % bounds): {', '.join(innovations)}",
    ]


def _facts(results: Results) -> dict[str, str]:
    about, plan = results.folder.about, results.folder.plan
    varied = [*(f"{key} = {text}" for key, text in about["vary"].items()), *(plan.sweep[0] if plan.sweep else ())]
    facts = {
        "seed": str(plan.seed),
        "varied": "; ".join(varied),
        "design": plan.design if plan.vary else "",
        "overrides": " ".join(plan.overrides),
        "success": " and ".join(about["success"]) or "always",
        "versions": ", ".join(f"{name} {text}" for name, text in about["versions"].items()),
    }
    return {name: text for name, text in facts.items() if text}


def _change(ratio: Interval) -> str:
    """Format a relative change: in per cent up to ten times."""
    if ratio.value < 9.0:
        return percent(ratio, signed=True)
    times, low, high = (f"{1.0 + number:.4g}" for number in ratio)
    return f"{times} times as large (95 % confidence interval {low} to {high})"


def comparison_result(comparison: Comparison) -> StudyResult:
    """Return the result of a comparison of two campaigns."""
    tracking = comparison.tracking
    failing = next(d.difference for d in comparison.differences if d.figure == "success")
    texts = [f"tracking error {_change(tracking)}"] if math.isfinite(tracking.value) else []
    n, first = comparison.pairs, comparison.first
    texts.append(f"failures {' and '.join(str(round(n * p.value)) for p in comparison.failures)} of {n}")
    if first:
        texts.append(f"first difference: {first.signal} at {first.time:g} s")
    elif not comparison.not_flown:
        texts.append("no difference in their flights")
    worse, better = failing.high < 0.0 or tracking.low > 0.0, failing.low > 0.0 or tracking.high < 0.0
    lead = [f"{n} pairs of runs" + f", {comparison.unpaired} without a pair left out" * bool(comparison.unpaired)]
    lead.append(f"differences: {', '.join(comparison.differing) or 'none'}")
    for name, p in zip(comparison.names, comparison.failures, strict=True):
        lead.append(f"{name}: failures {percent(p)}")
    lead.append(f"failed in the first only: {comparison.only_first}, in the second only: {comparison.only_second}")
    if first:
        apart = f"positions at most {first.apart:.3g} m apart, at {first.apart_time:g} s"
        lead.append(f"run {comparison.run}, whose error changes most: {apart}")
    elif comparison.not_flown:
        lead.append(f"first difference unknown: {comparison.not_flown}; record run {comparison.run} with both "
                    "(lapwing run SCENE --run N --campaign DIR --log FILE), then lapwing verify FILE FILE")  # fmt: skip
    title = "Means, and change from the first to the second with its 95 % interval (*: it excludes 0)"
    rows = Rows(title, "metric", "first", "second", "change", "from", "to")
    for d in comparison.differences:
        label, scale = ("success [%]", 100.0) if d.figure == "success" else label_and_factor(d.figure)
        means = (f"{scale * mean:.4g}" for mean in (d.one, d.other))
        rows.add(f"{label}{' *' * d.is_significant}", *means, *(f"{scale * change:+.3g}" for change in d.difference))
    mark = "" if worse == better else "bad" if worse else "good"
    title = " and ".join(comparison.names)
    return StudyResult(title, ", ".join(texts), mark, tuple(lead), (rows,), data=comparison._asdict())


def explanation_result(explanation: Explanation) -> StudyResult:
    """Return the result of the explanation of a failed run."""
    e, title = explanation, f"run {explanation.run} fails by {' and '.join(explanation.criteria)}"
    changes = [f"{c.key} = {_value(c.least)}" for c in e.changes]
    text = f"already with {' and '.join(changes)} alone" if changes else "by its seed alone, without a varied parameter"
    rows = Rows("Least change that still fails", "parameter", "scene", "succeeds", "fails", "drawn")
    for c in e.changes:
        rows.add(c.key, *(_value(value) for value in (c.nominal, c.passes, c.least, c.drawn)))
    lead = [f"the run: {e.outcome}", f"the least change: {e.least_outcome}"]
    if e.unneeded:
        lead.append(f"as in the scene, and it still fails: {', '.join(e.unneeded)}")
    notes = (f"{e.flights} flights. This flies the least change:", e.command)
    return StudyResult(title, text, "bad", tuple(lead), (rows,), notes=notes, data=e._asdict())


def _value(value: object) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
