"""Every option of every command is used by a test that runs the command as a process."""

import re
from pathlib import Path

import pytest
import typer

from lapwing.cli.main import app
from tests.commands import run_command

SHORT = "--set run.duration=0.2 --set success.require=[]"
GYROSTAT = Path("lapwing/scenes/gyrostat_blocked.toml").resolve()  # without a path, it names an accuracy problem
COMMANDS = {  # run here, in this order, in one folder
    "run": f"run hover {SHORT} --mode single-process --speed max --log a.mcap --report a.pdf --json a.json",
    "check": "check hover --set run.seed=2",
    "check --accuracy": "check hover --accuracy --json check.json --set solver.accuracy=1e-3 --set solver.step=0.004"
    " --set run.duration=1",
    "campaign": "campaign hover --set run.duration=0.2 --runs 4 --seed 2 --vary vehicle.mass=normal(10.4,0.1)"
    " --design lhs --out c --csv --json c.json --report c.html --workers 1",
    "sweep": "campaign hover --set run.duration=0.2 --sweep sweep.csv --out d --ci-half-width 0.49 --workers 1",
    "shard": "campaign hover --set run.duration=0.2 --runs 4 --seed 2 --out e --shard 1/1 --workers 1",
    "run of a campaign": "run hover --run 1 --campaign c --mode single-process --log r.mcap",
    "compare": "compare c e --json compare.json",
    "certificates": "certificates keys --days 2",
    "verify": "verify a.mcap --explain",
    "recover": "recover cut.mcap --out b.mcap",
    "export": "export a.mcap --csv csv --parquet parquet --mat a.mat --ulog a.ulg --topics /clock,/drone1/pose",
    "resimulate": "resimulate a.mcap --allow-code",
    "report": "report a.mcap --out b.png --vehicle drone1",
    "comparison": "report a.mcap r.mcap --out both.html --names first,second",
    "parameters": "parameters a.mcap --save a.params",
    "protocol": "protocol hover --set run.seed=2 --json protocol.json",
    "schema": "schema gains --out schema.json",
    "performance": "performance hover --json performance.json",
    "stability": "stability exact_time --slow --json stability.json --report stability.html",
    "new vehicle": "new vehicle my_quad --set mass=2.0",
    "diagram": "protocol hover --plot protocol.svg",
    "accuracy": f"accuracy {GYROSTAT} --set run.duration=5 --target 1e-3 --json accuracy.json --plot accuracy.png",
    "effects": "effects hover --set run.duration=0.2 --tolerance 0.02 --only air_density,collision --json effects.json"
    " --plot effects.svg",
    "stability sweep": "stability edges --sweep",
    "excitation": "run excitation --mode single-process --log excitation.mcap",
    "tune": "tune hover --set run.seed=2 --altitude 3.1 --yaw 2.1 --attitude 12 --position 1.5"
    " --from excitation.mcap --out gains.toml --report gains.html --force",
}
IDENTIFY = "tests/studies/identification/test_output_error.py::test_command_writes_airframe_with_provenance"
SENSOR_FIT = "tests/studies/identification/test_sensor_fit.py::test_command_writes_tables_that_scene_takes"
IMPORT = "tests/flights/log_import/test_import.py::test_command_writes_log_that_other_commands_read"
SEPARATE = "tests/services/mavlink/test_separate_link.py"
ELSEWHERE = {  # other tests by option; a test's file contains the option
    "identify": {
        **dict.fromkeys(
            (
                "--free",
                "--json",
                "--mapping",
                "--out",
                "--seed",
                "--set",
                "--windows",
                "--trim-force",
                "--trim-torque",
                "--horizons",
            ),
            IDENTIFY,
        ),
        "--sensors": SENSOR_FIT,
    },
    "import": {
        "--mapping": IMPORT,
        "--out": IMPORT,
        "--vehicle": "tests/flights/log_import/test_rosbag.py::test_command_selects_vehicle_of_bag",
        "--instance": "tests/flights/log_import/test_log_doubts.py::test_command_ends_with_table_and_takes_instance",
        "--twist-frame": "tests/flights/log_import/test_bag_frames.py::test_twist_that_contradicts_position",
    },
    "feed": dict.fromkeys(("--command", "--firmware", "--set", "--skip"), "tests/flights/log_import/test_feed.py"),
    "run": {
        "--shell": "tests/services/px4/test_flights.py",
        "--firmware-schedule": "tests/services/ardupilot/test_flights.py",
        "--allow-code": "tests/fmi/importer/test_import.py",
        "--force": "tests/studies/tune/test_procedure.py::test_force_flies_unstable_gains",
        "--plan": "tests/lapwing/test_environment_faults.py::test_broken_plan_is_rejected",
        "--key-prefix": "tests/lapwing/test_output_lock.py::test_run_rejects_log_that_is_being_written",
        "--foxglove": "tests/services/foxglove/test_foxglove.py",
        "--ros2": "tests/services/ros2/test_service.py",
        "--ros2-router": "tests/services/ros2/test_service.py",
        "--mavlink": "tests/services/mavlink/test_secured_run.py",
        "--mavlink-key": "tests/services/mavlink/test_secured_run.py",
        "--listen": "tests/cosim/test_run.py",
        "--insecure": "tests/cosim/test_run.py",
        "--endpoints": "tests/lapwing/test_joined.py",
        "--external": "tests/examples/test_rust_controller.py",
        "--keys": "tests/cosim/test_join.py",
        "--view": "tests/lapwing/test_live.py",
        "--realtime": "tests/cosim/executors/test_lockstep.py",
    },
    "service": {
        "--set": "tests/lapwing/test_joined.py",
        "--endpoints": "tests/lapwing/test_joined.py",
        "--insecure": "tests/lapwing/test_joined.py",
        "--key-prefix": "tests/lapwing/test_joined.py",
        "--log": "tests/lapwing/test_joined.py",
        "--foxglove": "tests/lapwing/test_joined.py",
        "--keys": "tests/cosim/test_join.py",
        "--listen": "tests/test_compose.py",
        "--speed": "tests/lapwing/test_joined.py",
        **dict.fromkeys(("--mavlink", "--mavlink-key", "--plan"), SEPARATE),
        "--ros2": "tests/services/ros2/test_service.py",
        "--ros2-router": "tests/services/ros2/test_service.py",
    },
    "effects": {"--list": "tests/lapwing/test_key_docs.py::test_list_has_every_effect_and_key"},
    "test": dict.fromkeys(("--junit", "--keep"), "tests/lapwing/test_scene_tests.py"),
    "check": {"--allow-code": "tests/fmi/importer/test_import.py"},
    "campaign": {
        "--cluster": "tests/studies/campaign/test_cluster.py",
        "--explain": "tests/studies/campaign/test_campaign.py::test_failed_run_shrinks_to_least_change",
        "--allow-code": "tests/fmi/importer/test_effect_inputs.py",
    },
    "replay": {
        **dict.fromkeys(("--speed", "--from", "--to", "--loop", "--topics", "--listen"), "tests/cosim/test_replay.py"),
        **dict.fromkeys(("--key-prefix", "--record"), "tests/cosim/test_replay.py"),
        "--foxglove": "tests/services/foxglove/test_foxglove.py",
        **dict.fromkeys(
            ("--insecure", "--ros2", "--ros2-router"),
            "tests/services/ros2/test_service.py::test_replay_appears_in_ros_graph",
        ),
        **dict.fromkeys(("--mavlink", "--mavlink-key"), SEPARATE),
    },
    "export-fmu": {
        **dict.fromkeys(("--out", "--part", "--fmi", "--cpu", "--set"), "tests/fmi/test_fmu.py"),
        "--allow-code": "tests/fmi/test_export_with_fmus.py",
    },
    "export-ssp": {
        **dict.fromkeys(("--out", "--fmi", "--cpu", "--set"), "tests/fmi/test_system_package.py"),
        "--allow-code": "tests/fmi/test_export_with_fmus.py",
    },
    "export-library": {
        **dict.fromkeys(("--out", "--part", "--cpu", "--set"), "tests/fmi/test_library.py"),
        "--allow-code": "tests/fmi/test_export_with_fmus.py",
    },
    "studio": {"--port": "tests/views/studio/test_studio.py::test_port_in_use_is_rejected_in_one_line"},
    "view": {"--rerun": "tests/lapwing/test_view.py"},
    "render": dict.fromkeys(
        ("--camera", "--fps", "--from", "--out", "--size", "--speed", "--to", "--with"), "tests/lapwing/test_render.py"
    ),
    "validate": {
        **dict.fromkeys(
            ("--horizons", "--json", "--mapping", "--report", "--set", "--stride", "--trim-force", "--trim-torque"),
            "tests/studies/validation/test_prediction.py::test_command_writes_errors_and_baselines",
        ),
        "--closed-loop": "tests/studies/validation/test_closed_loop.py::test_command_overlays_closed_loop",
    },
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("options")
    (path / "sweep.csv").write_text("vehicle.mass\n10.3\n10.4\n")
    return path


@pytest.mark.long
@pytest.mark.parametrize("name", COMMANDS)
def test_command_runs_with_its_options(folder, name):
    if name == "recover":
        (folder / "cut.mcap").write_bytes((folder / "a.mcap").read_bytes()[:-500])
    result = run_command(*COMMANDS[name].split(), code=0, folder=folder)
    assert "Traceback" not in result.stderr


def options(command, path=()):
    if hasattr(command, "commands"):
        for name, each in command.commands.items():
            yield from options(each, (*path, name))
    for parameter in command.params:
        if parameter.param_type_name == "option" and parameter.name not in ("help", "version"):
            yield " ".join(path), parameter.opts[0]


def untested():
    here = {(command, option) for command, option in options(typer.main.get_command(app))}
    used = {
        (command, option)
        for line in COMMANDS.values()
        for command in {command for command, _ in here}
        if line.startswith(f"{command} ")
        for option in re.findall(r" (--[a-z-]+)", line)
    }
    return here - used - {(command, option) for command, tests in ELSEWHERE.items() for option in tests}


def test_every_option_has_process_test():
    assert not untested()


def test_referenced_tests_exist_and_use_option():
    for command, tests in ELSEWHERE.items():
        for option, test in tests.items():
            path, _, name = test.partition("::")
            text = Path(path).read_text()
            assert f"def {name}" in text, test
            assert option in text, (test, option)
            assert re.search(rf"\b{command.split()[-1]}\b", text), (test, command)
