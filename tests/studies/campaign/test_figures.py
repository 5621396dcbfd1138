"""Figures of flights made up, whose answers are known."""

import json

import made_up
import numpy as np
import pytest
from typer.testing import CliRunner

from lapwing.cli.main import app
from services.table import load
from studies.campaign import show
from studies.campaign.figures import figures
from studies.campaign.study import campaign, spread, summary
from studies.terminal import console
from studies.tracking import AXES

HOVER = "scenes/hover.toml"
N = 400


ZERO = (0.0, 0.0, 0.0)


def flown(failure="", diverged=False, finished=True, setpoint=None, truth=None, estimate=None, armed=True):
    """A flight at 100 Hz: columns of some topics besides what stands still."""
    pose = {"pose.position": ZERO, "pose.orientation": made_up.LEVEL}
    still = {**pose, "velocity": ZERO, "motor_power": (100.0,), "ground_contact": False}
    return made_up.flight(
        N,
        failure=failure,
        diverged=diverged,
        truth={**still, **(truth or {})},
        setpoint={"position": ZERO, "yaw": 0.0, **(setpoint or {})},
        actuators={"attitude_reference": ZERO, "armed": armed},
        estimate={**pose, "position_std": (0.1, 0.1, 0.1), **(estimate or {})},
        status={"finished": finished, "landed": True},
    )


def test_errors_of_known_offsets():
    half = np.sin(0.05), np.cos(0.05)
    f = figures(
        3,
        flown(
            setpoint={"position": (1.0, 2.0, 3.0), "yaw": 0.2},
            truth={"pose.position": (0.9, 2.0, 3.2), "pose.orientation": (0.0, 0.0, *half)},  # a yaw of 0.1
            estimate={"pose.position": (1.0, 1.7, 3.2)},
        ),
    )
    assert f.seed == 3
    assert f.rmse == pytest.approx(dict(zip(AXES, (0.1, 0.0, 0.2, 0.0, 0.0, 0.1), strict=True)))
    assert f.rmse_estimate == pytest.approx(dict(zip(AXES, (0.0, 0.3, 0.2, 0.0, 0.0, 0.2), strict=True)))
    assert f.worst == pytest.approx(np.hypot(0.1, 0.2))
    assert f.inside == (1.0, 1.0, 1.0)
    assert f.energy == pytest.approx(400.0)
    assert f.verdict.kind == "landed"


def test_share_of_the_time_within_three_sigma():
    ramp = np.zeros((N, 3))
    ramp[:, 1] = np.linspace(0.0, 0.6, N)  # three sigma are reached half-way
    assert figures(1, flown(estimate={"pose.position": ramp})).inside == pytest.approx((1.0, 0.5, 1.0))


def test_only_the_armed_part_counts():
    armed = np.arange(N) < 10
    off = np.where(armed, 0.0, 5.0)[:, None] * np.ones(3)
    assert figures(1, flown(truth={"pose.position": off}, armed=armed)).worst == 0.0


def test_a_campaign_judges_as_a_single_run_does():
    touch = np.arange(N) > 300
    falling = np.where(touch, 0.0, -3.0)[:, None] * np.array([0.0, 0.0, 1.0])
    hit = figures(1, flown(truth={"ground_contact": touch, "velocity": falling}))
    assert (hit.verdict.kind, hit.touchdown, hit.failed) == ("crashed", 3.0, True)
    assert figures(1, flown("not finite at t = 1 s", diverged=True)).verdict.kind == "diverged"
    assert figures(1, flown(finished=False)).verdict.kind == "timed out"


def test_spread_names_the_worst():
    values = [(float(v), 100 + v) for v in range(101)]
    assert spread(values) == (50.0, 5.0, 95.0, 100.0, 200)
    assert spread(values, least=True).seed == 100


def test_on_the_truth_every_seed_flies_the_same_windless_path():
    found = campaign(load(HOVER), [3, 4, 5], lambda: None)
    assert [f.seed for f in found.flights] == [3, 4, 5]
    assert not found.failed
    assert len({f.worst for f in found.flights}) == 1
    assert found.rmse == found.rmse_estimate


def test_order_of_the_flights_does_not_matter():
    scene, one = load(HOVER), lambda k: figures(k, flown(truth={"pose.position": (0.01 * k, 0.0, 0.0)}))
    assert summary(scene, [one(1), one(2)]).rmse == summary(scene, [one(2), one(1)]).rmse


def test_table_json_and_plot(tmp_path, capsys):
    scene = load("scenes/delivery_mission.toml")
    crashed = figures(2, flown(finished=False, estimate={"pose.position": (0.2, 0.0, 0.0)}))
    found = summary(scene, [figures(1, flown(truth={"pose.position": (0.1, 0.1, 0.1)})), crashed])
    show.show(console(80), found)
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= 80
    assert "roll [°]" in said
    assert "x [m]" in said
    assert "2 flights, seeds 1 to 2" in said
    assert "…" not in said  # no digit is cut
    assert "0.2373" in said
    assert "2 flights: 1 landed, 1 timed out" in said
    assert "seed 2: Timed out at 3.99 s" in said
    show.write_json(tmp_path / "c.json", found)
    assert json.loads((tmp_path / "c.json").read_text())["failed"] == [2]
    show.plot(tmp_path / "c.png", found)
    assert (tmp_path / "c.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([HOVER, "--seeds", "0"], "--seeds 0: expected at least 1"),
        (["scenes/gyrostat_blocked.toml"], "expected a scene whose autopilot follows a [trajectory]"),
        ([HOVER, "--plot", "c.gif"], "--plot c.gif: expected a name that ends in .png, .svg or .pdf"),
    ],
)
def test_bad_input_is_one_line(arguments, message):
    result = CliRunner().invoke(app, ["campaign", *arguments])
    assert result.exit_code == 2
    assert message in result.output.replace("\n", " ")
    assert "Traceback" not in result.output
