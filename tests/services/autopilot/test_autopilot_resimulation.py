"""Resimulation of a recorded run, bit-for-bit, with the commands at their ticks."""

import shutil
from pathlib import Path

from flights import OPERATED, UP, command, scripted

from lapwing.cosim.config.serialise import first_difference
from lapwing.cosim.log import LogReader
from lapwing.runs.resimulate import recorded_config, resimulate
from lapwing.runs.single_process_run import fly_single
from lapwing.services.scene_resolver import load, resolve

SCENES = Path(__file__).parents[3] / "lapwing/scenes"


def fly(log, config, operator=None, sources=None):
    """Record a flight in a log. Return its digest."""
    fly_single(config, log, sources, operator=operator)
    with LogReader(log) as read:
        return read.digest()


def test_resimulated_commands_keep_their_ticks(tmp_path):
    log = tmp_path / "flight.mcap"
    script = UP | {4: [command("goto", 2.0, 1.0, 3.0)]}
    digest = fly(log, resolve(load("hover", [*OPERATED, "run.duration=6"])), scripted(script))
    assert resimulate(log) == (digest, digest)


def test_commands_of_plan_are_executed_once(tmp_path):
    log = tmp_path / "plan.mcap"
    config = resolve(load("hover", [*OPERATED, "run.duration=4"]), {"drone1": tuple(UP[0.04])})
    digest = fly(log, config)
    assert resimulate(log) == (digest, digest)


def test_run_without_operator_is_resimulated(tmp_path):
    log = tmp_path / "hover.mcap"
    digest = fly(log, resolve(load("hover", ["run.duration=2"])))
    assert resimulate(log) == (digest, digest)


def test_log_resimulates_without_scene_files(tmp_path):
    copy = shutil.copytree(SCENES, tmp_path / "scenes")
    scene = load(copy / "hover.toml", ["run.duration=2", "airframe.mass.total=9.5", "gains.tilt_limit=0.5"])
    shutil.rmtree(copy)
    log, config = tmp_path / "hover.mcap", resolve(scene)
    digest = fly(log, config, sources={name: content.decode() for name, content in scene.sources.items()})
    assert resimulate(log) == (digest, digest)
    with LogReader(log) as read:
        assert first_difference(recorded_config(read), config) is None
        assert read.attachments["airframe.toml"] == (SCENES / "vehicles" / "delivery_drone.toml").read_bytes()
