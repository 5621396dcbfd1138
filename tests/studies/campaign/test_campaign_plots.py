"""Plots of a campaign's report from synthetic tables."""

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from lapwing.flights.metrics import METRICS
from lapwing.studies.campaign.distributions import uniform
from lapwing.studies.campaign.plan import plan
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.verdict import verdict
from lapwing.views.report import matplotlib_figure
from lapwing.views.report.style import QUIET
from lapwing.views.studies import campaign_plots
from lapwing.views.studies.campaign_plots import MAX_KEYS, criteria_plot, errors, sensitivity
from lapwing.views.studies.campaign_result import result as campaign_result
from lapwing.views.studies.study_result import show
from lapwing.views.terminal import console

KEYS = ("a", "b")
MANY = tuple("abcdefghijkl")


def table(runs, sweep=None, keys=KEYS, published=(), **values):
    """Return the results of a campaign over `keys`; metrics without a function are NaN."""
    new_plan = plan("hover", runs=runs, vary={} if sweep else dict.fromkeys(keys, uniform(0, 1)), sweep=sweep)
    drawn = {key: np.array([new_plan.values(run)[key] for run in range(runs)], float) for key in keys}
    kinds = {"run": int, "seed": int, **dict.fromkeys(keys, float), "success": bool}
    kinds |= {name: str if name in ("outcome", "outcome_text") else float for name in METRICS}
    result = {name: np.full(runs, np.nan) for name in kinds}
    result |= {"run": np.arange(runs), "success": np.ones(runs, bool), "outcome": np.full(runs, "landed", object)}
    about = {"vehicles": [], "published": dict(published), "success": [], "scene": "hover"}
    arrays = result | drawn | {name: function(drawn) for name, function in values.items()}
    return Results(SimpleNamespace(arrays=lambda: arrays, plan=new_plan, about=about, kinds=kinds))


def bars(plot, panel, aim):
    """Return the length of the bars in a panel of `sensitivity` by parameter."""
    (result,) = [p for p in plot.panels if p.title == aim and p.x_label.startswith(panel)]
    return {bar.lane: bar.end - bar.start for bar in result.marks}


def test_missing_values_do_not_affect_other_metrics():
    def speed(drawn):
        return np.where(drawn["b"] < 0.5, drawn["a"], np.nan)  # half of the runs have no touchdown

    plot = sensitivity(table(400, **{"touchdown.speed": speed, "energy": lambda drawn: drawn["b"]}))
    assert {panel.title for panel in plot.panels} == {"touchdown.speed", "energy"}
    assert bars(plot, "rank", "touchdown.speed")["a"] == pytest.approx(1.0)
    assert abs(bars(plot, "rank", "touchdown.speed")["b"]) < 0.2
    assert bars(plot, "rank", "energy") == pytest.approx({"a": 0.0, "b": 1.0}, abs=0.15)


def test_published_value_is_not_on_the_edge():
    result = table(50, published={"rmse": {"x": 3.0}}, **{"rmse.x": lambda drawn: drawn["a"]})
    (panel,) = errors(result).panels
    published = panel.marks[-1].x[0]
    assert published == 3.0
    assert panel.x_range[0] < panel.marks[0].x.min()
    assert panel.x_range[1] > published + 0.03 * np.ptp(panel.x_range)


def test_correlations_within_chance_are_grey():
    plot = sensitivity(table(12, energy=lambda drawn: drawn["b"]))
    (panel,) = [panel for panel in plot.panels if panel.x_label == "rank correlation"]
    colours = {bar.lane: bar.colour for bar in panel.marks}
    assert bars(plot, "rank", "energy")["a"] != 0.0
    assert colours["a"] == QUIET != colours["b"]


def test_constant_parameter_has_no_share():
    def speed(drawn):
        drawn["b"][:] = np.where(drawn["b"] < 0.5, 0.25, drawn["b"])
        return np.where(drawn["b"] == 0.25, drawn["a"], np.nan)

    result = bars(sensitivity(table(400, **{"touchdown.speed": speed})), "share", "touchdown.speed")
    assert set(result) == {"a"}
    assert result["a"] == pytest.approx(1.0, abs=0.1)


def test_shares_are_omitted_for_correlated_parameters(tmp_path):
    lines = [f"{k / 100},{k / 50}" for k in range(100)]
    (tmp_path / "s.csv").write_text("\n".join(["a,b", *lines]))
    plot = sensitivity(table(100, tmp_path / "s.csv", energy=lambda drawn: drawn["a"]))
    assert [panel.x_label for panel in plot.panels] == ["rank correlation"]
    assert "unlike those of a sweep" in plot.caption


def failing_table(runs=200):
    """Return a campaign whose runs with a >= 0.25 miss a limit of the touchdown speed, which is a."""
    result = table(runs, **{"touchdown.speed": lambda drawn: drawn["a"], "rmse.z": lambda drawn: 0.01 * drawn["b"]})
    is_failed = result["touchdown.speed"] >= 0.25
    result.folder.about |= {"success": ["rmse.z < 0.1", "touchdown.speed < 0.25"], "vary": {}, "versions": {}}
    result.folder.path = "folder"
    result.columns["success"] = ~is_failed
    result.columns["outcome_text"] = np.where(is_failed, "Landed; not touchdown.speed < 0.25", "").astype(object)
    return result, int(is_failed.sum())


def test_verdict_names_failures_criteria_and_driver():
    result, failures = failing_table()
    text = verdict(result)
    share = f"{round(failures / 2)} % (95 % confidence interval "  # digits that n allows
    assert text.startswith(f"{failures} of 200 runs fail, {share}")
    assert f": {failures} by touchdown.speed < 0.25, 0 by rmse.z < 0.1; " in text
    assert text.endswith("; touchdown.speed is driven by a (1.0 of the variance)")
    first, *_ = campaign_result(result).plots
    assert first == "Criteria"


def test_first_figure_has_failing_metric_with_limit():
    result, failures = failing_table()
    bars, distribution = criteria_plot(result).panels
    lanes, ends = zip(*((bar.lane, bar.end) for bar in bars.marks), strict=True)
    assert lanes[:2] == (f"touchdown.speed < 0.25: {failures}", "rmse.z < 0.1: 0")
    assert lanes[2].startswith(f"any: {round(failures / 2)} % (95 % confidence\n")
    assert ends == pytest.approx((failures / 2, 0.0, failures / 2))
    assert sensitivity(result).panels[0].title == "touchdown.speed"
    assert distribution.x_label == "touchdown.speed [m/s]"
    assert distribution.marks[-1].x.tolist() == [0.25, 0.25]


def test_console_begins_with_verdict_and_fits_80_columns():
    result, failures = failing_table()
    screen = console(80)
    with screen.capture() as capture:
        show(screen, campaign_result(result))
    lines = capture.get().splitlines()
    assert lines[0].startswith(f"hover: {failures} of 200 runs fail")
    assert any(line.strip().startswith("touchdown.speed < 0.25") and "█" in line for line in lines)
    tables = [line for line in lines[1:] if not line.startswith("  ")]
    assert max(map(len, tables)) <= 80


def test_errors_are_shares_of_requirements():
    result = table(11, **{"rmse.x": lambda drawn: np.arange(11.0), "rmse.roll": lambda drawn: np.arange(11.0)})
    result.folder.about["success"] = ["rmse.roll < 0.1"]
    roll, x = sorted(errors(result).panels, key=lambda panel: panel.x_label)
    assert (x.x_label, x.marks[0].x.tolist()) == ("rmse.x [m]", list(range(11)))
    assert x.marks[0].y[-1] == 1.0
    assert roll.marks[1].x == pytest.approx(np.degrees([0.1, 0.1]))


def test_weak_parameters_are_listed_instead_of_plotted():
    result = table(200, keys=MANY, energy=lambda drawn: drawn["l"] + 0.5 * drawn["k"])
    assert len(bars(sensitivity(result), "rank", "energy")) == len(MANY)
    result.columns["success"] = result["energy"] < 0.7
    plot = campaign_plots.success(result)
    reported = plot.caption.partition("Omitted, because their influence is weakest: ")[2].rstrip(".").split(", ")
    assert len(reported) == len(MANY) - MAX_KEYS
    assert [panel.x_label for panel in plot.panels][:2] == ["l", "k"]
    assert {panel.x_label for panel in plot.panels} == set(MANY) - set(reported)


def test_printed_axis_labels_do_not_overlap():
    rmse = {f"rmse.{axis}": lambda drawn: 0.01 + 0.16 * drawn["a"] for axis in ("x", "y", "z")}
    with matplotlib_figure.plot_style():
        canvas = FigureCanvasAgg(matplotlib_figure.figure(errors(table(50, **rmse))))
        canvas.draw()
        boxes = [
            label.get_window_extent()
            for axes in canvas.figure.axes
            for label in axes.get_xticklabels()
            if label.get_text() and axes.get_xlim()[0] <= label.get_position()[0] <= axes.get_xlim()[1]
        ]
    assert len(boxes) >= 9
    assert not [1 for a, b in combinations(boxes, 2) if a.padded(2.0).overlaps(b)]


def test_shares_are_in_per_cent_and_consistency_ratios_are_not():
    shares = {"saturation", "within_95.nees", *(f"within_3sigma.{axis}" for axis in "xyz")}
    numbers = {name for name, unit in METRICS.items() if not unit and not name.startswith("outcome")}
    assert {name for name in numbers if campaign_plots.label_and_factor(name) == (f"{name} [%]", 100.0)} == shares
    assert {campaign_plots.label_and_factor(name) for name in numbers - shares} == {
        (name, 1.0) for name in numbers - shares
    }
