"""Scene of several vehicles from the command line: both modes, summary, report, resimulation."""

import json

import pytest
from page_texts import page_text

import lapwing
from lapwing import Flight
from lapwing.services.common.schemas.run_schema import SHIPPED
from tests.commands import assert_rejected, run_command

pytestmark = pytest.mark.long
SHORT = ["--set", "run.duration=1.5"]


def command(*arguments):
    return run_command(*arguments, code=0).stdout


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    output = command(
        "run", "fleet", *SHORT, "--mode", "single-process", "--log", folder / "a.mcap", "--json", folder / "a.json"
    )
    return folder, output, json.loads((folder / "a.json").read_text())


def test_fleet_summary_has_outcomes_and_separation(flown):
    folder, output, figures = flown
    assert list(figures["vehicles"]) == ["left", "right", "scout"]
    assert all(one["outcome"]["kind"] == "completed" for one in figures["vehicles"].values())
    assert figures["separation"]["vehicles"][1] == "scout"
    assert figures["separation"]["distance"] == pytest.approx(18.0**0.5, abs=0.1)  # initial positions
    assert "Nearest: " in output
    for name in figures["vehicles"]:
        flight = Flight.read(folder / "a.mcap", name)
        assert (flight.vehicle, flight.config.vehicle) == (name, name)
        assert flight.events
        assert list(flight.fleet) == ["left", "right", "scout"]
    assert Flight.read(folder / "a.mcap", "scout").origin.scene["vehicle"]["airframe"] == "quad_x"


def test_report_shows_all_paths(flown):
    folder, _, _ = flown
    text = page_text(folder / "a.html")
    assert "All vehicles from above" in text
    assert all(f'"name":"{name}"' in text for name in ("left", "right", "scout"))
    page = folder / "scout.html"
    command("report", folder / "a.mcap", "--vehicle", "scout", "--out", page)
    assert "quad_x" in page_text(page)
    assert_rejected(
        run_command("report", folder / "a.mcap", "--vehicle", "nobody"),
        "vehicle nobody; expected one of left, right, scout",
    )


def test_report_overlays_a_single_vehicle(flown):
    """Once: min() arg is an empty sequence."""
    folder, _, _ = flown
    command("run", "hover", "--set", "run.duration=1", "--mode", "single-process", "--log", folder / "alone.mcap")
    command("report", folder / "a.mcap", folder / "alone.mcap", "--out", folder / "both.html")
    assert "alone: a single vehicle" in page_text(folder / "both.html")


def test_info_verify_and_resimulate_accept_log_of_fleet(flown):
    folder, _, figures = flown
    log = folder / "a.mcap"
    reported = command("info", log)
    assert "left, right, scout" in reported
    assert [reported.count(f"\n{name}:\n") for name in ("left", "right", "scout")] == [1, 1, 1]  # events of each
    assert figures["digest"] in command("verify", log)
    assert f"digest {figures['digest']}" in command("resimulate", log)


def test_fleet_digest_is_equal_in_processes(flown):
    folder, _, figures = flown
    command("run", "fleet", *SHORT, "--log", folder / "b.mcap", "--json", folder / "b.json", "--key-prefix", "fleet")
    assert json.loads((folder / "b.json").read_text())["digest"] == figures["digest"]


def test_fleet_of_one_is_summarised_as_fleet(tmp_path):
    hover = (SHIPPED / "hover.toml").read_text().replace("[vehicle]", "[[vehicle]]")
    (tmp_path / "one.toml").write_text(hover)
    command("run", tmp_path / "one.toml", *SHORT, "--mode", "single-process", "--log", tmp_path / "a.mcap",
            "--json", tmp_path / "a.json")  # fmt: skip
    figures = json.loads((tmp_path / "a.json").read_text())
    assert (list(figures["vehicles"]), figures["separation"]) == (["drone1"], None)


def test_replay_publishes_every_vehicle(flown):
    folder, _, figures = flown
    output = command("replay", folder / "a.mcap", "--speed", "max", "--topics", "/left/ground_truth,/scout/imu",
                   "--listen", "tcp/127.0.0.1:0", "--record", folder / "r.mcap",
                   "--mavlink", "udpout:127.0.0.1:14599")  # fmt: skip
    assert "messages published" in output
    assert [f"mavlink: {name}: " in output for name in figures["vehicles"]] == [True] * 3
    assert "/scout/imu" in command("info", folder / "r.mcap")


OF_ONE = {
    "fly": lapwing.fly,
    "campaign": lambda scene: lapwing.campaign(scene, [1]),
    "Simulator": lapwing.Simulator,
    "Batch": lambda scene: lapwing.BatchSimulator(scene, 2),
}


@pytest.mark.parametrize("name", OF_ONE)
def test_python_api_for_one_vehicle_rejects_fleet(name):
    with pytest.raises(lapwing.SceneError, match="vehicle: there are 3; expected a scene with one vehicle"):
        OF_ONE[name]("fleet")


def test_command_for_one_vehicle_rejects_fleet_in_one_line():
    assert_rejected(run_command("tune", "fleet"), "vehicle: there are 3; expected a scene with one vehicle")


def test_overlapping_vehicles_have_crashed_unless_collision_is_false(tmp_path):
    """Without the effect nothing pushes them apart: two vehicles 0.1 m apart follow their paths and land."""
    near = ["run", "fleet", "--set", "vehicle.1.initial_position=[0.0,2.9]", "--mode", "single-process", "--log"]
    done = run_command(*near, tmp_path / "a.mcap", code=4)
    text = " ".join(done.stdout.split())
    assert "left: Crashed at 0.00 s: hit vehicle right" in text
    assert "passes through it: the scene has no effects.collision" in text
    assert "left: Landed" in command(*near, tmp_path / "b.mcap", "--set", "effects.collision=false")
