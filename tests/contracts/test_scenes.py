"""Every shipped scene is valid; scenes of published experiments reproduce the published figures."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from lapwing.cosim.log import LogReader
from lapwing.services.common.schemas.run_schema import Published
from lapwing.services.scene_resolver import load

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]


def fly(scene, folder):
    """Return the figures of a run in one process."""
    figures = folder / "figures.json"
    command = [sys.executable, "-m", "lapwing", "run", str(scene), "--mode", "single-process"]
    command += ["--log", str(folder / "log.mcap"), "--json", str(figures)]
    subprocess.run(command, check=True, timeout=600)
    return json.loads(figures.read_text())


def test_tuned_gains_on_sensors_stay_below_table_7(tmp_path):
    scene = ROOT / "lapwing/scenes/delivery_mission.toml"
    published = load(scene)[Published].rmse
    flight = fly(scene, tmp_path)
    assert flight["landed"]
    for axis, value in published.items():
        assert flight["rmse"][axis] < value, axis


def test_paper_gains_on_truth_reproduce_table_7_in_translation(tmp_path):
    scene = ROOT / "lapwing/scenes/delivery_paper.toml"
    published = load(scene)[Published].rmse
    flight = fly(scene, tmp_path)
    assert flight["landed"]
    for axis in "xyz":
        assert flight["rmse"][axis] == pytest.approx(published[axis], rel=0.25), axis


def test_full_delivery_returns_two_kilograms_lighter(tmp_path):
    scene = ROOT / "lapwing/scenes/delivery_full.toml"
    published = load(scene)[Published].rmse
    flight = fly(scene, tmp_path)
    assert flight["landed"]
    assert flight["sim_time_s"] > 120.0
    for axis, value in published.items():
        assert flight["rmse"][axis] < value, axis
    with LogReader(tmp_path / "log.mcap") as log:
        times_ns, truth = log.history("/drone1/ground_truth")
    t, height, thrust = times_ns * 1e-9, truth["pose.position.z"], truth["rotor_thrust"].sum(axis=1)
    there, home = ((t > begin) & (t < begin + 4.0) for begin in (13.0, 98.0))  # hovering at 10 m, before and after
    assert height[there | home].min() > 9.5
    assert thrust[there].mean() - thrust[home].mean() == pytest.approx(2.0 * 9.81, rel=0.05)
    assert abs(truth["pose.position"][-1][:2]).max() < 0.1
