"""Report of a campaign as a web page, PDF or image."""

import shlex
from collections.abc import Callable
from pathlib import Path

from lapwing.cosim.complete_file import complete_file
from lapwing.cosim.output_lock import write_errors
from lapwing.studies.campaign import campaign_plots, console_output
from lapwing.studies.campaign.results import Results
from lapwing.studies.report.matplotlib_figure import write_png
from lapwing.studies.report.page import render
from lapwing.studies.report.paper import Cover, Titled, write_pdf
from lapwing.studies.report.plot import NotRecordedError, Plot
from lapwing.studies.report.sections import Section
from lapwing.studies.tracking import AXES, unit_and_factor

WORST = 10  # listed runs
PLOTS: dict[str, Callable[[Results], Plot]] = {
    "Errors": campaign_plots.errors,
    "Probability of success": campaign_plots.success,
    "Touchdown": campaign_plots.touchdown,
    "Sensitivities": campaign_plots.sensitivity,
    "Other metrics": campaign_plots.others,
    "All parameters": campaign_plots.parallel,
}
LISTED = ("max_distance", "touchdown.speed", "max_tilt")  # metrics of the worst runs


def write(path: Path, results: Results) -> None:
    """Write the report in the format of the suffix: .html, .pdf or .png.

    Raises:
        ValueError: the file cannot be written.
    """
    sections = [_section(title, draw, results) for title, draw in PLOTS.items()]
    with write_errors(path), complete_file(path) as file:
        if path.suffix == ".html":
            file.write_text(_page(results, sections), encoding="utf-8")
        else:
            titled_plots = [Titled(section.title, section.plot) for section in sections if section.plot]
            if path.suffix == ".pdf":
                write_pdf(file, _cover(results), titled_plots)
            else:
                write_png(file, [titled.plot for titled in titled_plots])


def _section(title: str, draw: Callable[[Results], Plot], results: Results) -> Section:
    name = title.lower().replace(" ", "-")
    try:
        return Section(name, title, draw(results))
    except NotRecordedError as reason:
        return Section(name, title, missing=str(reason))


def _facts(results: Results) -> dict[str, object]:
    about, plan = results.folder.about, results.folder.plan
    facts = {
        "seed": plan.seed,
        "varied": "; ".join([f"{key} = {text}" for key, text in about["vary"].items()])
        + ("; " if plan.vary and plan.sweep else "")
        + ", ".join(plan.sweep[0] if plan.sweep else ()),
        "design": plan.design if plan.vary else "",
        "overrides": " ".join(plan.overrides),
        "success": " and ".join(about["success"]) or "always",
        "versions": ", ".join(f"{name} {text}" for name, text in about["versions"].items()),
    }
    return {name: text for name, text in facts.items() if text}


def _cover(results: Results) -> Cover:
    p = results.failure
    share = f"Failures: {p.value:.2%} of the flights, 95 % interval {p.low:.2%} to {p.high:.2%}"
    spreads = {axis: results.spread(f"rmse.{axis}") for axis in AXES}
    rows = [
        (
            f"{axis} [{unit_and_factor(axis)[0]}]",
            *(console_output.digits(unit_and_factor(axis)[1] * v) for v in (s.median, s.high, s.worst)),
        )
        for axis, s in spreads.items()
        if s is not None
    ]
    facts = tuple((name, str(text)) for name, text in _facts(results).items())
    return Cover(
        _title(results), results.outcome_text, (share,), ("RMSE", "median", "95 %", "worst"), tuple(rows), facts
    )


def _title(results: Results) -> str:
    return f"{results.scene}: {len(results) + len(results.rejected['run'])} runs"


def _page(results: Results, sections: list[Section]) -> str:
    plan = results.folder.plan
    labels = [campaign_plots.label_and_factor(name) for name in LISTED]
    worst = [
        {
            "run": int(row["run"]),
            "outcome_text": row["outcome_text"] or row["outcome"],
            "parameters": ", ".join(f"{key} {_short(row[key])}" for key in plan.keys),
            "figures": [f"{scale * row[name]:.3g}" for name, (_, scale) in zip(LISTED, labels, strict=True)],
            "command": shlex.join(
                ["lapwing", "run", plan.path, "--run", str(row["run"]), "--campaign", str(results.folder.path)]
            ),
        }
        for row in results.worst(WORST)
    ]
    rejected = zip(results.rejected["run"].tolist(), results.rejected["outcome_text"].tolist(), strict=True)
    return render(
        "campaign.html",
        title=_title(results),
        outcome_text=results.outcome_text,
        failure=results.failure,
        facts=_facts(results),
        labels=[label for label, _ in labels],
        worst=worst,
        vehicles=console_output.vehicle_cells(results),
        vehicle_heads=console_output.VEHICLE_COLUMNS,
        vehicle_title=console_output.VEHICLES,
        nearest=console_output.nearest_of(results) if results.vehicles else "",
        rejected=list(rejected)[:WORST],
        rejections=len(results.rejected["run"]),
        sections=sections,
    )


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
