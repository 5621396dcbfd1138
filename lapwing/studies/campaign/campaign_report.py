"""The report of a campaign: a page for a browser, or its plots on paper."""

import shlex
from collections.abc import Callable
from pathlib import Path

from lapwing.studies.campaign import campaign_plots, console_output
from lapwing.studies.campaign.results import Results
from lapwing.studies.report.matplotlib_figure import write_png
from lapwing.studies.report.page import render
from lapwing.studies.report.paper import Cover, Titled, write_pdf
from lapwing.studies.report.plot import NotRecordedError, Plot
from lapwing.studies.report.sections import Section
from lapwing.studies.tracking import AXES, shown

WORST = 10  # runs that are listed
PLOTS: dict[str, Callable[[Results], Plot]] = {
    "Errors": campaign_plots.errors,
    "Probability of success": campaign_plots.success,
    "Touch-down": campaign_plots.touchdown,
    "Which parameter matters": campaign_plots.matters,
    "Other figures": campaign_plots.others,
    "All parameters": campaign_plots.parallel,
}
LISTED = ("max_distance", "touchdown.speed", "max_tilt")  # of the worst runs


def write(path: Path, found: Results) -> None:
    """Write the report in the format of the name's ending: .html, .pdf or .png.

    Raises:
        ValueError: it cannot be written.
    """
    sections = [_section(title, draw, found) for title, draw in PLOTS.items()]
    try:
        if path.suffix == ".html":
            path.write_text(_page(found, sections), encoding="utf-8")
        else:
            drawn = [Titled(section.title, section.plot) for section in sections if section.plot]
            if path.suffix == ".pdf":
                write_pdf(path, _cover(found), drawn)
            else:
                write_png(path, [titled.plot for titled in drawn])
    except OSError as fault:
        raise ValueError(f"{path}: cannot write the report: {fault.strerror or fault}") from None


def _section(title: str, draw: Callable[[Results], Plot], found: Results) -> Section:
    name = title.lower().replace(" ", "-")
    try:
        return Section(name, title, draw(found))
    except NotRecordedError as reason:
        return Section(name, title, missing=str(reason))


def _facts(found: Results) -> dict[str, object]:
    about, plan = found.folder.about, found.folder.plan
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


def _cover(found: Results) -> Cover:
    p = found.failure
    share = f"Failures: {p.value:.2%} of the flights, 95 % interval {p.low:.2%} to {p.high:.2%}"
    spreads = {axis: found.spread(f"rmse.{axis}") for axis in AXES}
    rows = [
        (
            f"{axis} [{shown(axis)[0]}]",
            *(console_output.digits(shown(axis)[1] * v) for v in (s.median, s.high, s.worst)),
        )
        for axis, s in spreads.items()
        if s is not None
    ]
    facts = tuple((name, str(text)) for name, text in _facts(found).items())
    return Cover(_title(found), found.outcome_text, (share,), ("RMSE", "median", "95 %", "worst"), tuple(rows), facts)


def _title(found: Results) -> str:
    return f"{found.scene}: {len(found) + len(found.refused['run'])} runs"


def _page(found: Results, sections: list[Section]) -> str:
    plan = found.folder.plan
    heads = [campaign_plots.shown(name) for name in LISTED]
    worst = [
        {
            "run": int(row["run"]),
            "outcome_text": row["outcome_text"] or row["outcome"],
            "parameters": ", ".join(f"{key} {_short(row[key])}" for key in plan.keys),
            "figures": [f"{scale * row[name]:.3g}" for name, (_, scale) in zip(LISTED, heads, strict=True)],
            "command": shlex.join(
                ["lapwing", "run", plan.path, "--run", str(row["run"]), "--campaign", str(found.folder.path)]
            ),
        }
        for row in found.worst(WORST)
    ]
    refused = zip(found.refused["run"].tolist(), found.refused["outcome_text"].tolist(), strict=True)
    return render(
        "campaign.html",
        title=_title(found),
        outcome_text=found.outcome_text,
        failure=found.failure,
        facts=_facts(found),
        heads=[label for label, _ in heads],
        worst=worst,
        vehicles=console_output.vehicle_cells(found),
        vehicle_heads=console_output.VEHICLE_COLUMNS,
        vehicle_title=console_output.VEHICLES,
        nearest=console_output.nearest_of(found) if found.vehicles else "",
        refused=list(refused)[:WORST],
        refusals=len(found.refused["run"]),
        sections=sections,
    )


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
