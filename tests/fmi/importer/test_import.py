import subprocess
from pathlib import Path

import pytest
from event_fmu import write_event_fmu
from small_fmu import write_small_fmu

from lapwing.cosim.log import LogReader

pytest.importorskip("fmpy")

from fmpy import read_model_description

from lapwing.fmi.export.fmu import export_fmu
from lapwing.services import scene_resolver
from tests.combinations import rest_nightly
from tests.commands import assert_rejected, run_command

HOVER = Path("lapwing/scenes/hover.toml").resolve()
COLUMN = "actuators.motor_voltage.0"
SERVICE = """
[services.motor]
fmu = "{fmu}"
timeout = {timeout}
start = {{ {start} }}
[services.motor.inputs]
{inputs}
[services.motor.outputs]
{outputs}
"""
CRASH, HANG, FAIL, NAN_OUTPUT, EXIT, SLOW = 1, 2, 3, 4, 5, 6


def scene_with(
    folder: Path,
    fmu: str = "small.fmu",
    inputs: str = f'u = "{COLUMN}"',
    outputs: str = f'"{COLUMN}" = "y"',
    start: str = "",
    timeout: float = 60.0,
) -> Path:
    path = folder / "imported.toml"
    text = SERVICE.format(fmu=fmu, inputs=inputs, outputs=outputs, start=start, timeout=timeout)
    path.write_text(HOVER.read_text() + text)
    return path


def fly(scene: Path, log: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return run_command(
        "run", scene, "--allow-code", "--mode", "single-process", "--log", log,
        "--set", "run.duration=1.0", "--set", "success.require=[]", *options,
    )  # fmt: skip


def payloads(log: Path, suffix: str) -> list[tuple[int, bytes]]:
    with LogReader(log) as read:
        topics = [topic for topic in read.topics() if topic.endswith(suffix)]
        return [(time_ns, bytes(payload)) for _, _, time_ns, payload in read.messages(topics)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmu")
    write_small_fmu(path / "small.fmu")
    return path


@pytest.fixture(scope="module")
def plain_log(folder: Path) -> Path:
    log = folder / "plain.mcap"
    done = fly(HOVER, log)
    assert done.returncode == 0, done.stderr
    return log


@pytest.mark.long
def test_fmu_of_gain_one_does_not_change_flight(folder: Path, plain_log: Path) -> None:
    log = folder / "one.mcap"
    done = fly(scene_with(folder), log)
    assert done.returncode == 0, done.stderr
    assert payloads(log, "/ground_truth") == payloads(plain_log, "/ground_truth")
    assert len(payloads(log, "/custom_sensor/actuators_motor")) == 251


@pytest.mark.long
def test_gain_changes_flight_and_resimulation_repeats_it(folder: Path, plain_log: Path) -> None:
    log = folder / "half.mcap"
    done = fly(scene_with(folder, start="gain = 0.5"), log)
    assert done.returncode == 0, done.stderr
    assert payloads(log, "/ground_truth") != payloads(plain_log, "/ground_truth")
    done = run_command("resimulate", log, code=2)
    assert "has FMUs, machine code of their authors" in done.stderr
    done = run_command("resimulate", log, "--allow-code", code=0)
    assert "is identical" in done.stdout


@pytest.mark.nightly
def test_accuracy_is_measured_with_permission(folder: Path) -> None:
    """`check --accuracy` of a scene and of its log."""
    scene, log = scene_with(folder), folder / "checked.mcap"
    done = fly(scene, log)
    assert done.returncode == 0, done.stderr
    short = "--set", "run.duration=1.0"
    for arguments in ((str(log),), (str(scene), *short)):
        command = "check", *arguments, "--accuracy", "--set", "solver.accuracy=1e-2"
        done = run_command(*command)
        assert_rejected(done, "use --allow-code to run")
        done = run_command(*command, "--allow-code", code=0)


@pytest.mark.long
def test_changed_fmu_is_rejected_by_resimulation(folder: Path, tmp_path: Path) -> None:
    write_small_fmu(tmp_path / "small.fmu")
    log = tmp_path / "a.mcap"
    assert fly(scene_with(tmp_path), log).returncode == 0
    write_small_fmu(tmp_path / "small.fmu", unit_u="V")
    done = run_command("resimulate", log, "--allow-code")
    assert done.returncode != 0
    assert "the file has changed since the start of the run" in done.stderr


@pytest.mark.long
@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (CRASH, "services.motor: small.fmu: crashed (SIGSEGV) at t = 0.500 s"),
        (FAIL, "services.motor: small.fmu: doStep failed with status 3 at t = 0.500 s"),
        (NAN_OUTPUT, "services.motor: small.fmu: output y is nan at t = 0.500 s"),
        (EXIT, "services.motor: small.fmu: crashed (exit code 7) at t = 0.500 s"),
    ],
)
def test_fault_is_named_with_its_time_and_log_is_complete(folder: Path, fault: int, message: str) -> None:
    log = folder / f"fault_{fault}.mcap"
    done = fly(scene_with(folder, start=f"fault = {fault}"), log)
    assert done.returncode == 1
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert len(payloads(log, "/ground_truth")) >= 124


@pytest.mark.long
def test_hanging_fmu_is_ended_after_its_timeout(folder: Path) -> None:
    done = fly(scene_with(folder, start=f"fault = {HANG}", timeout=1.0), folder / "hang.mcap")
    assert done.returncode == 1
    assert "services.motor: small.fmu: no answer for 1 s at t = 0.500 s" in done.stderr


@pytest.mark.long
def test_step_longer_than_stall_is_awaited_in_multi_process_mode(folder: Path, plain_log: Path) -> None:
    """A step of 4 s; a service that reports no wait counts as stalled after 2.5 s."""
    log = folder / "slow.mcap"
    done = fly(scene_with(folder, start=f"fault = {SLOW}"), log, "--mode", "multi-process")
    assert done.returncode == 0, done.stderr
    assert payloads(log, "/ground_truth") == payloads(plain_log, "/ground_truth")


@pytest.mark.long
def test_timeout_longer_than_stall_is_named_in_multi_process_mode(folder: Path) -> None:
    log = folder / "hang_processes.mcap"
    done = fly(scene_with(folder, start=f"fault = {HANG}", timeout=4.0), log, "--mode", "multi-process")
    assert done.returncode == 1
    assert "services.motor: small.fmu: no answer for 4 s at t = 0.500 s" in done.stderr
    assert "stalled" not in done.stderr
    assert len(payloads(log, "/ground_truth")) >= 124


def test_fmu_without_allow_code_is_rejected(folder: Path) -> None:
    done = run_command("run", scene_with(folder), "--mode", "single-process", "--log", folder / "x.mcap", code=2)
    assert done.stderr.startswith("lapwing: services.motor: an FMU contains machine code")
    assert done.stderr.count("\n") == 1


@pytest.mark.long
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fmu": "missing.fmu"}, "no such file"),
        ({"fmu": "imported.toml"}, "not an FMU"),
        ({"inputs": f'v = "{COLUMN}"'}, "services.motor.inputs.v: unknown variable 'v'; expected one of u\n"),
        (
            {"outputs": f'"{COLUMN}" = "v"'},
            f"services.motor.outputs.\"{COLUMN}\": unknown variable 'v'; expected one of y\n",
        ),
        ({"start": "gian = 1.0"}, "services.motor.start.gian: unknown variable 'gian'; expected one of gain, "),
        ({"inputs": f'y = "{COLUMN}"'}, "y has causality output; expected an input of the FMU: u\n"),
        ({"outputs": f'"{COLUMN}" = "u"'}, "u has causality input; expected an output of the FMU: y\n"),
        ({"inputs": 'u = "wing.lift"'}, "unknown port 'wing'"),
        ({"inputs": 'u = "truth.position_world.7"'}, "unknown column"),
        (
            {"start": "label = 1.0"},
            "services.motor.start.label: expected a text for a scalar variable, got 1.0 for the type String",
        ),
        ({"start": 'gain = "a"'}, "services.motor.start.gain: expected a number, got the text 'a' for the type Real"),
        (
            {"inputs": 'u = "actuators.motor_voltage.0"', "outputs": '"truth.position_world.2" = "y"'},
            "an algebraic loop",
        ),
    ],
)
def test_invalid_fmu_table_is_rejected_in_one_line(folder: Path, changes: dict, message: str) -> None:
    done = fly(scene_with(folder, **changes), folder / "invalid.mcap")
    assert done.returncode in (1, 2)
    assert message in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"platform": "win64"}, "has binaries for win64; expected an FMU for Linux on x86-64"),
        ({"unit_u": "m"}, f"u is in m, but {COLUMN} is in V; expected variables of the same quantity"),
    ],
)
def test_unusable_fmu_is_rejected_by_name(tmp_path: Path, options: dict, message: str) -> None:
    write_small_fmu(tmp_path / "small.fmu", **options)
    with pytest.raises(ValueError, match=r"services\.motor") as error:
        scene_resolver.resolve(scene_resolver.load(scene_with(tmp_path)))
    assert message in str(error.value)


def test_units_of_one_quantity_are_converted(tmp_path: Path) -> None:
    write_small_fmu(tmp_path / "small.fmu", unit_u="ft", unit_y="m")
    inputs, outputs = 'u = "truth.position_world.2"', '"trajectory.position_world.2" = "y"'
    config = scene_resolver.resolve(scene_resolver.load(scene_with(tmp_path, inputs=inputs, outputs=outputs)))
    fmu = config.services["motor_fmu"].parameters
    assert fmu.inputs[0].factor == pytest.approx(1 / 0.3048)
    assert fmu.outputs[0].factor == 1.0


@pytest.mark.parametrize(
    ("unit", "message"),
    [
        ("degC", "h is in degC, a unit with an offset"),
        ("furlong", "h is in furlong, which the FMU does not define"),
        ("s", "h is in s, but trajectory.position_world.2 is in m"),
    ],
)
def test_unit_that_cannot_be_converted_is_rejected(tmp_path: Path, unit: str, message: str) -> None:
    write_event_fmu(tmp_path / "ball.fmu", unit=unit)
    scene = scene_with(tmp_path, "ball.fmu", "", '"trajectory.position_world.2" = "h"')
    with pytest.raises(ValueError, match=r"services\.motor") as error:
        scene_resolver.resolve(scene_resolver.load(scene))
    assert message in str(error.value)


def test_unit_of_fmu_is_converted_by_its_definition(tmp_path: Path) -> None:
    write_event_fmu(tmp_path / "ball.fmu", unit="foot")
    scene = scene_with(tmp_path, "ball.fmu", "", '"trajectory.position_world.2" = "h"')
    config = scene_resolver.resolve(scene_resolver.load(scene))
    assert config.services["motor_fmu"].parameters.outputs[0].factor == pytest.approx(0.3048)


BALL = """
[services.ball]
fmu = "ball.fmu"
embed = true
start = { e = 0.8 }
[services.ball.inputs]
"u[0]" = "truth.velocity_world.2"
[services.ball.outputs]
"trajectory.position_world.2" = "h"
"""


@pytest.mark.long
def test_fmu_with_events_flies_and_is_resimulated_from_log_alone(tmp_path: Path) -> None:
    write_event_fmu(tmp_path / "ball.fmu")
    scene = tmp_path / "ball.toml"
    scene.write_text(HOVER.read_text() + BALL)
    log = tmp_path / "ball.mcap"
    done = fly(scene, log)
    assert done.returncode == 0, done.stderr
    assert payloads(log, "/custom_sensor/trajectory_ball")
    (tmp_path / "ball.fmu").unlink()
    done = run_command("resimulate", log, "--allow-code", code=0)
    assert "is identical" in done.stdout


@pytest.mark.long
def test_port_of_longer_period_is_replaced(folder: Path) -> None:
    log = folder / "battery.mcap"
    battery = 'u = "battery.voltage"', '"battery.voltage" = "y"'
    scene = scene_with(folder, inputs=battery[0], outputs=battery[1], start="gain = 0.99")
    done = fly(scene, log)
    assert done.returncode == 0, done.stderr
    samples = payloads(log, "/custom_sensor/battery_motor")
    assert [time_ns for time_ns, _ in samples] == [100_000_000 * k for k in range(11)]


@pytest.mark.parametrize("kind", ["ModelExchange", "ScheduledExecution"])
def test_fmu_of_other_interface_is_rejected(tmp_path: Path, kind: str) -> None:
    write_event_fmu(tmp_path / "ball.fmu", kind)
    scene = scene_with(tmp_path, "ball.fmu", "", '"trajectory.position_world.2" = "h"')
    message = r"services\.motor\.fmu: .*ball\.fmu: is not for co-simulation; expected an FMU exported for co-simulation"
    with pytest.raises(ValueError, match=message):
        scene_resolver.resolve(scene_resolver.load(scene))


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('u = "actuators.motor_voltage"', "u has 2 elements, but actuators.motor_voltage has 4"),
        ('"u[2]" = "actuators.motor_voltage.0"', "u[2]: no such element; expected indices from 0 of an array of 2"),
        ('"h[0]" = "actuators.motor_voltage.0"', "h[0] has causality output"),
        ('v = "actuators.motor_voltage.0"', "v has causality output; expected an input of the FMU"),
        ('"u[0]" = "battery.charge"', "no effect of the scene models battery.charge; expected another column, or an"),
    ],
)
def test_incompatible_connection_is_rejected(tmp_path: Path, line: str, message: str) -> None:
    write_event_fmu(tmp_path / "ball.fmu")
    scene = scene_with(tmp_path, "ball.fmu", line, '"trajectory.position_world.2" = "h"')
    with pytest.raises(ValueError, match=r"services\.motor") as error:
        scene_resolver.resolve(scene_resolver.load(scene))
    assert message in str(error.value)


@pytest.mark.long
@pytest.mark.parametrize("version", rest_nightly(3, 2))
@pytest.mark.parametrize("mode", rest_nightly("single-process", "multi-process"))
def test_exported_autopilot_flies_like_built_in_one(version: int, mode: str, tmp_path: Path) -> None:
    path = tmp_path / "pilot.fmu"
    export_fmu(scene_resolver.resolve(scene_resolver.load("hover")), "autopilot", path, version)
    variables = read_model_description(str(path)).modelVariables

    def column(name: str) -> str:
        return name.replace("[", ".").replace("]", "").replace(",", ".")

    inputs = "\n".join(f'"{v.name}" = "{column(v.name)}"' for v in variables if v.causality == "input")
    outputs = "\n".join(
        f'"{column(v.name)}" = "{v.name}"'
        for v in variables
        if v.causality == "output" and v.name.startswith("actuators.")
    )
    scene = scene_with(tmp_path, "pilot.fmu", inputs, outputs)
    logs = [tmp_path / "own.mcap", tmp_path / "fmu.mcap"]
    for each, log in zip((HOVER, scene), logs, strict=True):
        run_command("run", each, "--allow-code", "--mode", mode, "--log", log, code=0)
    assert payloads(logs[0], "/ground_truth") == payloads(logs[1], "/ground_truth")


def test_long_list_of_variables_begins_with_nearest_ones(tmp_path: Path) -> None:
    path = tmp_path / "plant.fmu"
    export_fmu(scene_resolver.resolve(scene_resolver.load("hover")), "plant", path)
    scene = scene_with(tmp_path, "plant.fmu", f'"actuators.motor_volt[2]" = "{COLUMN}"')
    with pytest.raises(ValueError, match=r"unknown variable 'actuators.motor_volt\[2\]'") as error:
        scene_resolver.resolve(scene_resolver.load(scene))
    _, _, listed = str(error.value).partition("expected one of ")
    assert listed.startswith("actuators.motor_voltage[2], actuators.motor_voltage[")
    assert "truth" not in listed
    assert listed.endswith(" more")
    assert listed.count(",") == 9
