"""Names of scenes and logs that are markup or formulas: every page shows them as text."""

import copy
import html
import json
import re

import flights_in_space
import numpy as np
import pytest

from lapwing.flights.flight_events import Event
from lapwing.views import report
from lapwing.views.report import write
from lapwing.views.report.matplotlib_figure import write_png
from lapwing.views.report.page import render
from lapwing.views.report.plot import Band, Level, Line, Panel, Plot, Stretch
from lapwing.views.report.plotly_figure import figure
from lapwing.views.report.sections import Section
from lapwing.views.studies.study_result import Rows, StudyResult
from lapwing.views.view3d import headless

HOSTILE = "\"'><img src=x onerror='top.hit=1'><script>top.hit=2</script>$\\q$ {{7*7}} %{x}"
RAW = ("<img", "<script>top")
PHASES = np.full(flights_in_space.TICKS, HOSTILE, object)


def flight():
    """Return a flight in which all names from scene and log are hostile."""
    setpoint = {"position": (0.0, 0.0, 1.0), "yaw": 0.0, "phase": PHASES}
    values = flights_in_space.flight(setpoint=setpoint)
    values.origin = copy.copy(values.origin)
    values.vehicle = values.name = HOSTILE
    values.origin.scene["run"] = {"title": HOSTILE}
    values.origin.scene["effects"] = {HOSTILE: {HOSTILE: HOSTILE}}
    values.origin.scene["published"] = {"source": HOSTILE, "rmse": {"x": 1.0}}
    values.events = [Event(1.0, kind, HOSTILE) for kind in ("fault", "phase", HOSTILE)]
    return values


def plot():
    """Return a plot with a hostile name in each place."""
    x = np.linspace(0.0, 1.0, 20)
    marks = (Line(x, x, HOSTILE), Line(x, x), Band(x, x, x + 1.0, HOSTILE), Level(0.5, HOSTILE))
    texts = {"y_label": HOSTILE, "x_label": HOSTILE, "title": HOSTILE, "note": HOSTILE}
    panels = (
        Panel(marks, **texts, timed=False),
        Panel((Stretch(HOSTILE, 0.0, 1.0, HOSTILE),), row=1),
        Panel((Line(x, x),), row=2, timed=False, x_ticks=(HOSTILE,)),
    )
    return Plot(panels, HOSTILE, 6.0, (1.0,) * 3, phases=((HOSTILE, 0.0, 1.0),), span=(0.0, 1.0))


def pages():
    """Yield name and text of each page from the report's templates."""
    section = [Section("plot", HOSTILE, plot()), Section("missing", HOSTILE, missing=HOSTILE)]
    rows = Rows(HOSTILE, HOSTILE, HOSTILE, caption=HOSTILE)
    rows.add(HOSTILE, HOSTILE, failed=True)
    texts = (HOSTILE,) * 2
    result = StudyResult(HOSTILE, HOSTILE, "bad", texts, (rows, rows), {}, texts, {HOSTILE: HOSTILE})
    yield "study", render("study.html", section, result=result)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Return the paths of all pages."""
    folder = tmp_path_factory.mktemp("pages")
    paths = [write(flight(), folder / "report.html", view3d=True)]
    paths.append(write([flight(), flight()], folder / "comparison.html", view3d=True))
    for name, text in pages():
        paths.append(folder / f"{name}.html")
        paths[-1].write_text(text, encoding="utf-8")
    return paths


def test_pages_escape_names(written):
    for path in written:
        text = path.read_text(encoding="utf-8")
        assert not [raw for raw in RAW if raw in text], path
        assert html.escape(HOSTILE)[:20] in text.replace("&#34;", "&quot;").replace("&#39;", "&#x27;"), path


def test_templates_mark_no_name_as_safe():
    folder = headless.Path(report.__file__).parent
    safe = {name for path in folder.glob("*.html") for name in re.findall(r"(\w+) \| safe", path.read_text("utf-8"))}
    assert safe == {"library", "code", "view3d"}


def test_plots_escape_names():
    assert not [raw for raw in RAW if raw in json.dumps(figure(plot()))]


def test_paper_shows_formulas_as_text(tmp_path):
    write_png(tmp_path / "plot.png", [plot()])
    write(flight(), tmp_path / "flight.pdf")


@pytest.mark.long
@pytest.mark.skipif(headless.PROGRAM is None, reason="needs Chromium")
def test_browser_runs_no_name(written):
    with headless.Browser("data:text/html,empty", (1000, 900)) as browser:
        for path in written:
            browser.call("Page.navigate", url=path.resolve().as_uri())
            drawn, hit = browser.run(
                """
                const until = async (holds) => {
                  for (let k = 0; k < 2400 && !holds(); k++) await new Promise((done) => setTimeout(done, 50));
                  if (!holds()) throw new Error(`never: ${holds}`);
                };
                await until(() => document.readyState === "complete");
                for (const details of document.querySelectorAll("details")) details.open = true;
                const plots = [...document.querySelectorAll("figure.plot")];
                for (const plot of plots) {
                  plot.scrollIntoView();
                  await until(() => plot.querySelector(".main-svg"));
                }
                const frame = document.querySelector("#space iframe");
                if (frame) await until(() => frame.contentWindow.lapwingView?.ready);
                return [plots.length, window.hit ?? 0];
                """
            )
            assert (drawn > 0, hit) == (True, 0), path
            assert not [line for line in browser.errors if "ERR_FILE_NOT_FOUND" in line], path  # of the picture
