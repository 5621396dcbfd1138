"""Stability study: complete runs of cheap cases, printed and written results, exit codes."""

import json
import math
import re
import signal
from types import SimpleNamespace

import numpy as np
import pytest

from lapwing.cli.study_commands import stability
from lapwing.cosim.processes.interrupt import Interrupted
from lapwing.studies.stability import case_runner, cases
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep
from lapwing.studies.stability.case_runner import run_case, select
from lapwing.views.studies.stability_result import distance

pytestmark = pytest.mark.long


@pytest.mark.parametrize("name", ["exact_time", "lie_limits"])  # `make stability` runs every case
def test_case_passes_and_baseline_fails(name):
    result = run_case(name, False)
    assert result.figures.rows
    for row in result.figures.rows:
        assert row.passes, (row.name, row.measured, row.bound)
        assert not row.baseline_passes, (row.name, row.baseline_measured)
    assert result.figures.plot.curves


def test_every_case_describes_its_difficulty():
    for name in cases.names():
        assert cases.get(name).HARD
        assert cases.get(name).__doc__.startswith("Case ")


def row(measured, baseline, bound=1.0):
    return Row("row", "ours", "x", bound, "why", measured, "baseline", baseline)


@pytest.fixture
def fake_case(monkeypatch):
    """Return a function that installs a case with the given rows."""

    def make(*rows):
        plot = Plot("x", "y", [Curve("a", np.arange(3.0), np.array([1.0, np.nan, 2.0]))], 1.5)
        module = SimpleNamespace(HARD="hard", run=lambda: CaseResult(rows, plot), __name__="fake")
        monkeypatch.setattr(cases, "get", lambda name: module)
        monkeypatch.setattr(cases, "names", lambda: ["fake"])

    return make


def test_json_and_page(fake_case, tmp_path, capsys):
    fake_case(row(0.5, 2.0), row(0.0, math.nan, 0.0))
    stability("fake", json=tmp_path / "s.json", report=tmp_path / "s.html")
    values = {"name": "fake.row", "bound": 1.0, "measured": 0.5, "verdict": "pass"}
    assert json.loads((tmp_path / "s.json").read_text())["cases"] == [
        {**values, "baseline_measured": 2.0, "baseline_verdict": "fail"},
        {**values, "bound": 0.0, "measured": 0.0, "baseline_measured": None, "baseline_verdict": "fail"},
    ]
    page = (tmp_path / "s.html").read_text()
    assert page.count('<figure class="plot">') == 1
    assert 'src="http' not in page
    assert "fake" in capsys.readouterr().out


@pytest.mark.parametrize(
    "rows", [[row(2.0, 3.0)], [row(math.nan, 3.0)], [row(0.1, 0.2)]], ids=["over", "nan", "baseline passes"]
)
def test_exit_code_1_when_case_fails(fake_case, rows):
    fake_case(*rows)
    with pytest.raises(SystemExit) as ended:
        stability("fake")
    assert ended.value.code == 1


def test_case_that_ends_in_error_fails(monkeypatch):
    def broken():
        raise ValueError("out of reach")

    monkeypatch.setattr(cases, "get", lambda name: SimpleNamespace(HARD="hard", run=broken))
    result = run_case("broken", False)
    assert not result.is_conclusive
    assert "out of reach" in result.figures.rows[0].invariant


def test_interrupt_names_finished_cases(fake_case, monkeypatch):
    fake_case(row(0.5, 2.0))
    finished = run_case("fake", False)

    def measure(names, sweep):
        yield finished
        raise Interrupted(signal.SIGINT)

    monkeypatch.setattr(case_runner, "measure", measure)
    with pytest.raises(Interrupted, match="SIGINT; 1 of 1 cases finished: fake; all cases hold their bounds"):
        stability("fake")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"case": "loping"}, "unknown case 'loping'; did you mean looping?"),
        ({"case": "exact_time", "sweep": True}, "exact_time has no sweep"),
        ({"report": "page.txt"}, "expected a name that ends in .html"),
    ],
)
def test_invalid_case_is_rejected(arguments, message, tmp_path):
    if "report" in arguments:
        arguments = {"report": tmp_path / arguments["report"]}
    with pytest.raises(ValueError, match=re.escape(message)):
        stability(**arguments)


def test_slow_cases_need_option():
    assert "day_of_flight" not in select(None, False, False)
    assert "day_of_flight" in select(None, True, False)
    assert "lie_limits" not in select(None, False, True)


def test_first_difficulty_beyond_bound():
    x = np.array([1.0, 2.0, 3.0, 4.0])
    curves = [Curve("breaks", x, np.array([0.1, 5.0, 0.1, 9.0])), Curve("never", x, x * 0.0)]
    assert Sweep("d", "e", 1.0, curves).breaks() == {"breaks": 2.0, "never": None}
    assert Sweep("d", "e", 1.0, curves, falling=True).breaks() == {"breaks": 4.0, "never": None}
    assert Sweep("d", "e", 1.0, [Curve("nan", x, x * np.nan)]).breaks() == {"nan": 1.0}


def test_margin_to_bound():
    assert distance(1.0, 0.5) == "2 x"
    assert distance(1.0, 0.0) == "exact"
    assert distance(0.0, 0.0) == ""
