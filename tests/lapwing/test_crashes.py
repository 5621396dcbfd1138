"""Crashes by the real command: the first cause in words, with numbers that the true state confirms."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lapwing.flights.flight_data import FlightData
from lapwing.runs import single_process_run
from tests.scenes import head, phase, vehicle

SINGLE = ("--mode", "single-process", "--log", "a.mcap", "--json", "a.json")
HUB = 0.35171491  # [m] of the delivery drone, along x and y
FEET = 0.35  # [m] below its centre


def crash(lapwing, *arguments):
    """Return the words of a crash, its outcome in JSON, its flights and the words of its report's top."""
    code, out, err = lapwing("run", *arguments, *SINGLE)
    assert (code, "crashed" in err) == (4, True), (code, out, err)
    reported = json.loads(Path("a.json").read_text())
    page = Path("a.html").read_text()
    assert 'class="good"' not in page
    assert 'outcome good"' not in page
    return " ".join(out.split()), reported, FlightData.read_all("a.mcap"), page


@pytest.mark.long
def test_crash_into_building_names_it_with_height_and_speed(lapwing):
    far, near = "{position=[40.0,0.0],size=[2.0,4.0],top=9.0}", "{position=[3.0,0.0],size=[2.0,6.0],top=5.0}"
    box = f"environment.terrain.box=[{far},{near}]"
    ahead = 'trajectory.phase.1.x={kind="minimum_jerk", to=6.0, duration=3.0}'
    words, reported, (flight,), page = crash(lapwing, "hover", "--set", box, "--set", ahead)
    found = re.search(r"Crashed at (\S+) s: hit building 2 \(wall\), (\S+) m above ground, at (\S+) m/s; ", words)
    assert found, words
    assert found[0].removesuffix("; ") in page
    assert reported["outcome"]["causes"][0]["text"].startswith("hit building 2 (wall)")
    truth, time = flight.truth, float(found[1])
    k = int(np.argmax(truth.position[:, 0] + HUB > 2.0))  # the first row with the hubs beyond the wall's face
    assert time == pytest.approx(truth.times[k], abs=0.05)
    assert float(found[2]) == pytest.approx(truth.position[k, 2] - FEET, abs=0.15)
    assert float(found[3]) == pytest.approx(np.linalg.norm(truth.velocity[k - 1]), rel=0.05)
    contacts = [event["text"] for event in reported["events"] if event["kind"] == "contact"]
    assert contacts[1].startswith("touches building 2 (wall)")
    later = [event for event in reported["events"] if event["kind"] in ("fault", "failsafe") and event["time"] > time]
    assert all(event["text"].startswith("after the crash: ") for event in later)
    assert bool(later) == ("After the crash: " in words)


@pytest.mark.long
def test_crash_after_motor_failure_names_the_motor_first(lapwing):
    words, reported, (flight,), _ = crash(
        lapwing, "hover", "--set", "effects.rotor_damage.rotor=2", "--set", "effects.rotor_damage.time=4.0"
    )
    assert re.search(r"Crashed at \S+ s: rotor 2 keeps 0 % of its thrust at 4\.00 s; ", words), words
    causes = [(cause["time"], cause["text"]) for cause in reported["outcome"]["causes"]]
    assert causes == sorted(causes)
    over = float(flight.truth.times[flight.truth.tilt_cosine < 0.0][0])
    assert next(time for time, text in causes if text == "turned over in the air") == pytest.approx(over)
    assert reported["outcome"]["time"] == pytest.approx(over)
    assert causes[-1][1].startswith("hit the ground at ")


WALL = 'environment.terrain.box=[{position=[%s, 0.0], size=[2.0, 8.0], top=9.0, name="garage"}]'
AHEAD = 'trajectory.phase.1.x={kind="minimum_jerk", to=8.0, duration=3.0}'
ALL = {  # one set of effects, so that the kernels compile once
    "effects.rotor_damage": "{rotor=2, time=100.0}",
    "effects.wind_gust": "{peak=[0.0, 0.0, 0.0], start=3.0, duration=2.0}",
    "effects.battery": "{}",
    "effects.body_drag": "{area=[0.3, 0.3, 0.3]}",
}


@pytest.mark.long
@pytest.mark.parametrize(
    ("settings", "exit_code", "mark", "text"),
    [
        (
            ["effects.rotor_damage.time=4.0", WALL % 4.0, AHEAD], 4, "bad",
            r"^Crashed at 4.2\d s: rotor 2 keeps 0 % of its thrust at 4\.00 s; hit garage \(wall\), 0\.8 m above ",
        ),
        (
            ["effects.wind_gust.peak=[20.0, 0.0, 0.0]", WALL % 1.75], 0, "warn",
            r"^Landed at .* hit garage \(wall\), \S+ m above ground, at 0\.\d+ m/s, at 4\.\d\d s; ends at ",
        ),
        (
            ["effects.battery={initial_charge=0.05, cutoff_voltage=3.7}", WALL % 50.0], 4, "warn",
            r"never left the ground; the battery switched off: all rotors lost thrust at 0\.00 s; failsafe \(",
        ),
        ([WALL % 4.0, AHEAD], 4, "bad", r"hit garage \(wall\), .* m/s; turned over .* later; ends tilted by \d+° at "),
    ],
    ids=["lost rotor before a wall", "gust into a wall", "battery that switches off", "lies on its side"],
)  # fmt: skip
def test_causes_are_named_in_their_order(lapwing, settings, exit_code, mark, text):
    sets = [f"{key}={value}" for key, value in ALL.items()] + settings
    code, out, err = lapwing("run", "hover", *SINGLE, *[part for item in sets for part in ("--set", item)])
    outcome = json.loads(Path("a.json").read_text())["outcome"]
    assert (code, outcome["mark"]) == (exit_code, mark), (out, err)
    assert re.search(text, outcome["text"]), outcome["text"]


@pytest.mark.long
def test_crash_into_another_vehicle_names_it(lapwing):
    vehicles = [
        vehicle(name, phase("climb", 3.0, z=3.0), phase("meet", 4.0, x=-x), phase("land", 4.0, z=0.0), start=(x, 0.3))
        for name, x in (("left", -4.0), ("right", 4.0))
    ]
    Path("meeting.toml").write_text(head(20.0, "collision") + "".join(vehicles))
    words, reported, (left, right), page = crash(lapwing, "meeting.toml")
    assert re.search(r"left: Crashed at \S+ s: hit vehicle right, 3\.0 m above ground, at \S+ m/s", words), words
    assert re.search(r"right: Crashed at \S+ s: hit vehicle left, ", words), words
    assert "right: Crashed at " in page
    distance = np.linalg.norm(left.truth.position - right.truth.position, axis=1)
    met = left.truth.times[int(np.argmax(distance < 2.0 * (np.hypot(HUB, HUB) + 0.2794)))]  # around the rotors' tips
    assert reported["vehicles"]["left"]["outcome"]["time"] == pytest.approx(met, abs=0.1)


def plan_of(*items, **parts):
    """Write a.plan: items are (command, first four parameters, north, east, up)."""
    rows = [
        {
            "type": "SimpleItem",
            "frame": 3,
            "command": command,
            "params": [*first, 40.7686 + north / 111052.0, 14.7907 + east / 84400.0, up],
        }
        for command, first, north, east, up in items
    ]
    Path("a.plan").write_text(json.dumps({"fileType": "Plan", "mission": {"items": rows}, **parts}))
    return "--plan", "a.plan"


NONE = (0.0, 0.0, 0.0, None)
TAKEOFF, WAYPOINT, RETURN = (22, NONE, 0.0, 0.0, 5.0), (16, NONE, 0.0, 6.0, 5.0), (20, NONE, 0.0, 0.0, 0.0)
BUILDING = "environment.terrain.box=[{position=[3.0,0.0],size=[2.0,6.0],top=9.0}]"


@pytest.mark.long
def test_plan_whose_leg_goes_through_a_building_crashes_and_ends(lapwing):
    plan = plan_of(TAKEOFF, WAYPOINT, RETURN)
    words, _, (flight,), _ = crash(lapwing, "hover", *plan, "--set", BUILDING, "--set", "run.duration=300.0")
    found = re.search(r"Crashed at (\S+) s: hit building 1 \(wall\), (\S+) m above ground, at (\S+) m/s", words)
    assert found, words
    time = float(found[1])
    before = flight.truth.velocity[flight.truth.times < time - 0.002][-1]
    assert float(found[3]) == pytest.approx(np.linalg.norm(before), abs=0.05)  # not that of later contacts
    assert flight.truth.times[-1] < time + 40.0


def test_return_to_rally_point_and_stay_in_the_air_are_as_planned(lapwing):
    rally = {"rallyPoints": {"points": [[40.7686, 14.7907 + 6.5 / 84400.0, 0.0]]}}
    plan = plan_of(TAKEOFF, WAYPOINT, RETURN, **rally)
    code, out, err = lapwing("run", "hover", *plan, *SINGLE, "--set", "run.duration=80.0")
    assert (code, "Landed at " in out) == (0, True), (out, err)
    plan = plan_of(TAKEOFF, WAYPOINT)
    code, out, err = lapwing("run", "hover", *plan, *SINGLE, "--set", "run.duration=15.0")
    assert (code, "Completed at 15.00 s: plan flown, ends in the air" in out) == (0, True), (out, err)


@pytest.mark.long
def test_service_that_is_killed_is_named_in_the_report(tmp_path):
    name = tmp_path / "a"
    command = [sys.executable, "-m", "lapwing", "run", "hover", "--speed", "1", "--set", "run.duration=200.0"]
    command += ["--log", f"{name}.mcap", "--json", f"{name}.json", "--set", "trajectory.phase.1.duration=190.0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        next(line for line in run.stdout if line.startswith("t = "))
        children = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
        os.kill(int(children[-1]), signal.SIGKILL)
        out, err = run.communicate(timeout=300)
    found = re.search(r"lapwing: (\w+ ended unexpectedly \(signal 9\) at t = \S+ s)", err)
    assert (run.returncode, bool(found)) == (1, True), (out, err)
    outcome = json.loads((tmp_path / "a.json").read_text())["outcome"]
    assert (outcome["kind"], outcome["mark"], outcome["how"]) == ("aborted", "bad", found[1])
    assert found[1] in (tmp_path / "a.html").read_text()


def test_motors_stopped_at_maximum_height_are_cause_of_crash(lapwing):
    fence = ("autopilot.parameters.FS_FENCE_ACT=5", "autopilot.parameters.GF_MAX_VER_DIST=4.0")
    climb = 'trajectory.phase.0.z={kind="minimum_jerk", to=8.0, duration=4.0}'
    words, reported, (flight,), _ = crash(lapwing, "hover", *[a for x in (*fence, climb) for a in ("--set", x)])
    found = re.search(
        r"Crashed at (\S+) s: the vehicle is too high above home: the autopilot stopped the motors in flight, (\S+) m "
        r"above ground, at (\S+) m/s, at (\S+) s; hit the ground at (\S+) m/s, ",
        words,
    )
    assert found, words
    impact, height, speed, start, fall = map(float, found.groups())
    assert height == pytest.approx(4.0, abs=0.6)
    assert fall == pytest.approx(np.sqrt(speed**2 + 2.0 * 9.80665 * height), rel=0.02)
    assert impact - start == pytest.approx((speed + fall) / 9.80665, rel=0.05)
    assert flight.truth.times[-1] < impact + 5.0
    assert [event["text"] for event in reported["events"] if event["kind"] == "failsafe"] == [
        "the vehicle is too high above home"
    ]


def test_flight_that_never_leaves_the_ground_is_not_good(lapwing):
    sink, rise = (f'{{kind="minimum_jerk", to={z}, duration={t}}}' for z, t in ((-0.1, 3.0), (0.0, 1.0)))
    low = f"trajectory.phase.0.z=[{sink}, {rise}]"
    code, out, err = lapwing("run", "hover", *SINGLE, "--set", low, "--set", "run.duration=8.0")
    assert (code, "timed out" in err) == (4, True), (out, err)
    assert "never left the ground" in out
    assert json.loads(Path("a.json").read_text())["outcome"]["mark"] == "warn"
    assert 'outcome good"' not in Path("a.html").read_text()


def test_run_that_is_ended_after_landing_has_landed(lapwing, monkeypatch):
    lapwing("run", "hover", *SINGLE)
    status = FlightData.read("a.mcap").status
    done = int(np.flatnonzero(status.armed)[-1]) + 1
    last = round((status.times[done] + 0.5) * 250)
    advance = single_process_run.run_single

    def interrupted(diagram, recording, speed, observe, _):
        advance(diagram, recording, speed, lambda diagram: observe(diagram), last)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(single_process_run, "run_single", interrupted)
    code, out, err = lapwing("run", "hover", *SINGLE)
    assert (code, err) == (0, "")
    assert "Landed at " in out
    assert FlightData.read("a.mcap").metadata["failure"] == "the run was ended"
