"""Pages of real flights, written by the commands as processes and opened in a browser."""

import pytest
from page_texts import page_text

from lapwing.views.view3d import headless
from tests.commands import run_command

SMALL, WITH_VIEW = 2_000_000, 5_000_000  # [byte] of a page
UNTIL = """
    const until = async (holds) => {
      for (let k = 0; k < 2400 && !holds(); k++) await new Promise((done) => setTimeout(done, 50));
      if (!holds()) throw new Error(`never: ${holds}`);
    };
    await until(() => document.readyState === "complete");
"""
pytestmark = pytest.mark.long
needs_chromium = pytest.mark.skipif(headless.PROGRAM is None, reason="needs Chromium (apt-get install chromium)")


def run(folder, *arguments):
    """Run a command of Lapwing in a folder; return what it prints."""
    return run_command(*arguments, code=0, folder=folder).stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with two delivery missions, a.mcap and b.mcap, and the report a.html of the first."""
    made = tmp_path_factory.mktemp("pages")
    for name, gains in (("a", "tuned"), ("b", "paper")):
        sets = ("--set", f"autopilot.gains={gains}")
        run(made, "run", "delivery_mission", "--mode", "single-process", "--log", f"{name}.mcap", *sets)
    return made


def test_report_of_run_is_small(folder):
    assert (folder / "a.html").stat().st_size < SMALL


def test_comparison_is_small_and_has_every_plot(folder):
    run(folder, "report", "a.mcap", "b.mcap", "--out", "both.html", "--names", "tuned,paper")
    text = (folder / "both.html").read_text(encoding="utf-8")
    view = text.partition('id="space"')[2].partition("</section>")[0]
    assert len(text) - len(view) < SMALL
    assert len(text) < WITH_VIEW
    assert 'id="motors"' in text


def test_report_of_modelled_battery_has_its_margin(folder):
    battery = ("--set", "effects.battery={initial_charge=0.3}", "--log", "battery.mcap")
    run(folder, "run", "delivery_mission", "--mode", "single-process", *battery)
    written = page_text(folder / "battery.html")
    run(folder, "report", "battery.mcap", "--out", "again.html")
    again = page_text(folder / "again.html")
    for text in (written, again):
        assert "energy drawn [W h]" in text
        assert "% of the charge is left" in text
        assert "above 15 % (warning)" in text
    assert "the scene has no battery model" in page_text(folder / "a.html")


@needs_chromium
def test_browser_draws_every_plot(folder):
    with headless.Browser(folder / "a.html") as browser:
        count = browser.run(
            UNTIL
            + """
            const figures = [...document.querySelectorAll("figure.plot")];
            for (const figure of figures) {
              for (let e = figure.parentElement; e; e = e.parentElement) if (e.tagName === "DETAILS") e.open = true;
              figure.scrollIntoView();
              await until(() => figure.querySelector(".main-svg .trace, .main-svg .point"));
            }
            return figures.length;
            """
        )
        assert browser.errors == []
    assert count >= 8
