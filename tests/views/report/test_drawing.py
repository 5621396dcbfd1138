"""Drawing of the plots: arrays, axes, legends, cursor and the reduced script."""

import importlib
import re
import sys

import numpy as np
import pytest
from circle_report import values

from lapwing.views.report import plotly_figure, plotly_script
from lapwing.views.report.plot import Line, Panel, Plot, thin
from lapwing.views.report.plotly_figure import figure
from lapwing.views.report.plots import air
from lapwing.views.report.style import POINTS


@pytest.mark.parametrize("log_axis", [False, True])
def test_arrays_keep_gaps_and_axis_resolution(log_axis):
    inputs = np.geomspace(1e-6, 1e3, 300)
    inputs[7] = np.nan
    actual = values(plotly_figure._array(inputs, log=log_axis))
    assert np.isnan(actual[7])
    assert actual == pytest.approx(
        inputs, nan_ok=True, **({"rel": 1e-6} if log_axis else {"rel": 0, "abs": 1e3 / 65534})
    )


def test_array_beyond_its_axis_keeps_resolution_of_axis():
    inputs = np.append(np.linspace(0.0, 1.0, 50), 1e6)
    assert values(plotly_figure._array(inputs, shown=(0.0, 1.0))) == pytest.approx(inputs, rel=1e-6, abs=1e-7)


def test_array_of_a_diverged_curve_ends_at_largest_number():
    inputs = np.append(np.ones(50), 1e302)
    assert values(plotly_figure._array(inputs, log=True))[-1] == pytest.approx(np.finfo("<f4").max)


def test_reduced_script_keeps_registered_kinds_of_traces():
    reduced = plotly_script.remove_unused_traces(plotly_script.script())
    kinds = set(re.findall(r'moduleType:"trace",name:"(\w+)"', reduced))
    assert {"scatter", "bar"} <= kinds
    assert not kinds & {"scatter3d", "scattermap", "pie", "heatmap"}
    assert len(plotly_script.gzip_base64(reduced)) < 700_000


def test_script_of_another_build_is_not_reduced():
    assert plotly_script.remove_unused_traces("Plotly = {}") == "Plotly = {}"


def test_turbulence_is_drawn_as_mean_and_range():
    times, rng = np.arange(0.0, 10.0, 0.004), np.random.default_rng(1)
    wind = np.array([3.0, 0.0, 0.0]) + rng.normal(size=(len(times), 3))
    *bands, x, _, _ = air._wind(times, wind)
    assert len(x.x) == 10
    assert x.y == pytest.approx(wind[:, 0].reshape(10, 250).mean(axis=1))
    assert bands[0].high == pytest.approx(wind[:, 0].reshape(10, 250).max(axis=1))


def test_script_is_found_in_package_without_other_files(tmp_path, monkeypatch):
    script = tmp_path / "plotly" / "package_data" / "plotly.min.js"
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    with pytest.raises(ValueError, match=r"pip install lapwing\[report\]"):
        plotly_script.script()
    script.parent.mkdir(parents=True)
    script.write_text("Plotly = {}")
    importlib.invalidate_caches()
    assert plotly_script.script() == "Plotly = {}"


def test_legend_of_long_names_has_room_above_panels():
    def top(*names):
        marks = tuple(Line(np.arange(3.0), np.arange(3.0), name) for name in names)
        return figure(Plot((Panel(marks),), "", 3.0))["layout"]["margin"]["t"]

    name = "the reference of a flight whose name is longer than half of a line"  # one fits into a line
    assert np.diff([top(*(f"{name} {k}" for k in range(count))) for count in range(4)]).tolist() == [22, 28, 28]


def test_cursor_between_samples_shows_value_and_full_name():
    name = "reference, B & a long name"
    drawn = figure(Plot((Panel((Line(np.arange(3.0), np.arange(3.0), name),)),), "", 3.0, span=(0.0, 2.0)))
    (line,) = (trace for trace in drawn["data"] if trace["type"] == "scatter")
    assert line["hovertemplate"] == "%{y}"  # Plotly's default is "(time, value)" unless a sample is at the cursor
    assert drawn["layout"]["hoverlabel"]["namelength"] == -1


def test_names_of_short_phases_are_left_out_on_phone():
    phases = (("climb", 0.0, 50.0), ("item 2 of 7", 50.0, 60.0), ("i", 60.0, 100.0))
    panel = Panel((Line(np.arange(3.0), np.arange(3.0)),))
    drawn = figure(Plot((panel,), "", 3.0, span=(0.0, 100.0), phases=phases))["layout"]["annotations"]
    assert [(one["text"], one["name"]) for one in drawn] == [("climb", ""), ("item 2 of 7", "wide"), ("i", "")]


def test_texts_at_both_ends_of_axis_have_room():
    panel = Panel(
        (Line(np.arange(3.0), np.arange(3.0)),), timed=False, x_ticks=("[0.0, 0.0, 0.0]", "b", "[9.0, 3.0, 0.0]")
    )
    axis = figure(Plot((panel,), "", 3.0))["layout"]["xaxis"]
    assert axis["range"] == [-0.5, 2.5]
    assert axis["ticktext"] == list(panel.x_ticks)


@pytest.mark.parametrize("count", [POINTS, POINTS + 1, 17051])
def test_thinning_line_keeps_its_peaks_and_ends(count):
    t = np.linspace(0.0, 1.0, count)
    y = np.sin(50.0 * t)
    y[count // 3], y[-2] = 9.0, -9.0
    drawn_t, drawn_y = thin(t, y)
    assert len(drawn_t) <= POINTS + 2
    assert (np.diff(drawn_t) > 0.0).all()
    assert (drawn_t[0], drawn_t[-1]) == (0.0, 1.0)
    assert set(zip(drawn_t, drawn_y, strict=True)) <= set(zip(t, y, strict=True))
    assert (drawn_y.max(), drawn_y.min()) == (9.0, -9.0)


def test_labelled_axis_has_room_for_numbers_of_many_digits():
    line = Line(np.arange(50.0), 4.9e-4 + 1e-7 * np.arange(50.0))
    panels = tuple(Panel((line,), label, timed=False, column=k) for k, label in enumerate(("position [m]", "")))
    layout = figure(Plot(panels, "", 3.0))["layout"]
    assert layout["yaxis"]["automargin"]
    assert "automargin" not in layout["yaxis2"]
