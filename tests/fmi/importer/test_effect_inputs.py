"""Outputs of FMUs as named inputs of effects: battery, motors and wind, through the command `lapwing run`."""

import re
from pathlib import Path

import numpy as np
import pytest
from effect_fmu import ROTORS, write_effect_fmu

pytest.importorskip("fmpy")

from lapwing import SceneError, read_log
from lapwing.api.batch_simulator import BatchSimulator
from lapwing.cosim.log import LogReader
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.fmi.export.exported_part import export_part
from lapwing.fmi.export.variables import variables_of
from lapwing.services import scene_resolver
from tests.combinations import rest_nightly
from tests.commands import assert_rejected, run_command

HOVER = Path("lapwing/scenes/hover.toml").resolve()
EFFECTS = """
[effects.wind_constant]
velocity = {wind}
[effects.body_drag]
[effects.battery]
[effects.dc_motor]
"""
PARTS = """
[services.parts]
fmu = "parts.fmu"
embed = true
start = {{ {start} }}
[services.parts.inputs]
{inputs}
[services.parts.outputs]
{outputs}
"""
SUPPLY = '"effect.battery.voltage" = "supply"'
WIND = "\n".join(f'"effect.wind_constant.velocity.{i}" = "wind_{axis}"' for i, axis in enumerate("xyz"))

TORQUES = "\n".join(f'"effect.dc_motor.torque.{k}" = "torque_{k}"' for k in range(ROTORS))
STILL_AIR = '"effect.wind_constant.velocity.2" = "wind_z"'
ALL = f"{SUPPLY}\n{STILL_AIR}\n{TORQUES}"  # inputs of all three effects, so that the plants of the tests are equal code
MEASURED = "\n".join(
    f'voltage_{k} = "actuators.motor_voltage.{k}"\nspeed_{k} = "truth.rotor_speed.{k}"\n'
    f'current_{k} = "truth.motor_current.{k}"'
    for k in range(ROTORS)
)
FULL_PACK = "open_circuit = 49.0, resistance = 0.0"


def motor_constants() -> str:
    """Return start values of motors without friction: torque e K (V - K w) / R."""
    motor = load_airframe("lapwing/scenes/vehicles/delivery_drone.toml").motor
    return (
        f"torque_constant = {motor.belt_efficiency * motor.rotor_constant!r}, "
        f"speed_constant = {motor.rotor_constant!r}, winding = {motor.resistance + motor.esc_resistance!r}"
    )


def scene_with(folder: Path, outputs: str, pack: str = FULL_PACK, wind: str = "[0.0, 0.0, 0.0]") -> Path:
    scene = folder / "effects.toml"
    start = f"wind = 3.0, {pack}, {motor_constants()}"
    parts = PARTS.format(outputs=outputs, inputs=MEASURED, start=start) if outputs else ""
    scene.write_text(HOVER.read_text() + EFFECTS.format(wind=wind) + parts)
    return scene


def fly(scene: Path, log: Path, mode: str = "single-process", rate: int = 250) -> str:
    done = run_command(
        "run", scene, "--allow-code", "--mode", mode, "--log", log, "--set", "run.duration=1.0",
        "--set", "success.require=[]", "--set", "airframe.motor.no_load_current=0.0",
        "--set", f"communication.rate={rate}", code=0)  # fmt: skip
    digest = re.search(r"digest\s+(\w+)", done.stdout)
    assert digest
    return digest[1]


def true_states(log: Path) -> list[bytes]:
    with LogReader(log) as read:
        topics = [topic for topic in read.topics() if topic.endswith("/ground_truth")]
        return [bytes(payload) for _, _, _, payload in read.messages(topics)]


def readings(log: Path, name: str) -> np.ndarray:
    """Return the samples of a port that an FMU computes, shape (n, columns)."""
    return read_log(log).topic(f"custom_sensor/{name}").values


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("effects")
    write_effect_fmu(path / "parts.fmu")
    return path


@pytest.mark.long
def test_wind_equal_to_own_does_not_change_flight(folder: Path) -> None:
    steady = "[3.0, 1.5, 0.0]"
    own, external = folder / "own.mcap", folder / "external.mcap"
    fly(scene_with(folder, "", wind=steady), own)
    fly(scene_with(folder, WIND, wind=steady), external)
    assert true_states(own) == true_states(external)


@pytest.mark.long
def test_wind_of_fmu_acts_one_tick_after_its_sample(folder: Path) -> None:
    log = folder / "wind.mcap"
    fly(scene_with(folder, "\n".join(WIND.splitlines()[:2])), log)
    wind = read_log(log).truth.wind
    assert np.array_equal(wind[0], [0.0, 0.0, 0.0])
    assert np.array_equal(wind[1:], np.tile([3.0, 1.5, 0.0], (len(wind) - 1, 1)))
    assert np.isnan(readings(log, "effect_wind_constant")[:, 2]).all()


@pytest.mark.long
def test_battery_of_fmu_supplies_motors_and_own_charge_is_counted(folder: Path) -> None:
    log = folder / "battery.mcap"
    fly(scene_with(folder, ALL, "open_circuit = 44.0, resistance = 0.004"), log)
    flight, samples = read_log(log), readings(log, "effect_battery")
    current = flight.truth.motor_current.sum(axis=1)
    assert samples[:, 0] == pytest.approx(44.0 - 0.004 * current, abs=1e-9)
    assert np.isnan(samples[:, 1]).all()
    battery = flight.topic("battery")
    later = np.round(battery.times[1:] * 250).astype(int) - 1
    assert battery.voltage[1:] == pytest.approx(samples[later, 0], rel=1e-6)
    assert (flight.truth.motor_voltage[1:].max(axis=1) <= samples[:-1, 0]).all()
    assert battery.percentage[-1] < battery.percentage[0]


@pytest.mark.long
def test_charge_of_fmu_is_published(folder: Path) -> None:
    log = folder / "charge.mcap"
    fly(scene_with(folder, f'{ALL}\n"effect.battery.charge" = "charge"'), log)
    battery = read_log(log).topic("battery")
    assert battery.percentage[1:] == pytest.approx(1.0 - 0.01 * (battery.times[1:] - 0.004), abs=1e-6)


@pytest.mark.long
def test_voltage_below_cutoff_stops_motors_for_good(folder: Path) -> None:
    log = folder / "cutoff.mcap"
    fly(scene_with(folder, ALL, "open_circuit = 35.9, resistance = 0.0"), log)
    truth = read_log(log).truth
    assert (truth.motor_voltage[1:] == 0.0).all()


@pytest.mark.long
def test_motors_of_fmu_fly_like_own_ones(folder: Path) -> None:
    """Motors without friction; differences: the coupling of 1 ms, and the current limit of the own ones."""
    logs = [folder / "own_motors.mcap", folder / "fmu_motors.mcap"]
    fly(scene_with(folder, ""), logs[0], rate=1000)
    fly(scene_with(folder, ALL), logs[1], rate=1000)
    one, other = (read_log(log).truth for log in logs)
    assert other.rotor_speed[-1] == pytest.approx(one.rotor_speed[-1], rel=0.01)
    assert other.motor_current[-1] == pytest.approx(one.motor_current[-1], rel=0.02)
    assert other.motor_power[-1] == pytest.approx(one.motor_power[-1], rel=0.03)
    assert 0.0 < np.abs(other.position - one.position).max() < 0.05


@pytest.mark.long
def test_speed_of_fmu_is_reached_one_tick_later(folder: Path) -> None:
    log = folder / "speed.mcap"
    outputs = "\n".join(f'"effect.dc_motor.speed.{k}" = "next_speed"' for k in range(ROTORS))
    fly(scene_with(folder, f"{SUPPLY}\n{STILL_AIR}\n{outputs}"), log)
    truth = read_log(log).truth
    assert truth.rotor_speed[1:, 2] == pytest.approx(10.0 + truth.times[:-1], rel=1e-12)


@pytest.mark.long
def test_modes_campaign_and_resimulation_have_equal_bits(folder: Path) -> None:
    scene, log, campaign = scene_with(folder, ALL), folder / "bits.mcap", str(folder / "campaign")
    assert fly(scene, log) == fly(scene, folder / "bits_processes.mcap", mode="multi-process")
    options = ["--set", "run.duration=1.0", "--set", "success.require=[]"]
    done = run_command("campaign", scene, "--runs", "1", "--out", campaign, *options, code=2)
    assert done.stderr.endswith("use --allow-code to run it\n")
    done = run_command(
        "campaign", scene, "--runs", "2", "--workers", "2", "--out", campaign, "--allow-code", *options, code=0
    )
    done = run_command(
        "run", scene, "--campaign", campaign, "--run", "1", "--allow-code", "--mode", "single-process", "--log",
        folder / "run1.mcap",
    )  # fmt: skip
    assert "final state bit-for-bit identical" in done.stdout, done.stderr
    done = run_command("resimulate", log, "--allow-code", code=0)
    assert "is identical" in done.stdout


@pytest.mark.long
def test_exported_plant_has_named_inputs(folder: Path) -> None:
    exported = export_part(scene_resolver.resolve(scene_resolver.load(scene_with(folder, ALL))), "plant")
    (voltage,) = [v for v in variables_of(exported) if v.name == "effect.battery.voltage"]
    assert (voltage.causality, voltage.unit) == ("input", "V")


@pytest.mark.long
@pytest.mark.parametrize(
    ("outputs", "message"),
    rest_nightly(
        ('"effect.batery.voltage" = "supply"', "unknown effect 'batery'; did you mean battery?"),
        ('"effect.battery.volts" = "supply"', "unknown column 'effect.battery.volts'"),
        ('"effect.battery.voltage" = "wind_x"', "wind_x is in m/s, but effect.battery.voltage is in V"),
        ('"effect.battery_thevenin.voltage" = "supply"', "the scene has no effect battery_thevenin"),
        ('"effect.gravity.acceleration" = "supply"', "the effect gravity has no named inputs"),
        ('"effect.battery" = "supply"', "supply has 1 elements, but effect.battery has 2"),
        ('"effect" = "supply"', "unknown port 'effect'"),
        keep=3,
    ),
)
def test_invalid_effect_input_is_rejected_in_one_line(folder: Path, outputs: str, message: str) -> None:
    assert_rejected(
        run_command("run", scene_with(folder, outputs), "--allow-code", "--log", folder / "x.mcap"),
        "services.parts.outputs",
        message,
    )


def test_effect_input_cannot_be_read(folder: Path) -> None:
    scene = scene_with(folder, SUPPLY)
    scene.write_text(scene.read_text().replace("truth.motor_current.0", "effect.battery.voltage"))
    done = run_command("run", scene, "--allow-code", "--log", folder / "x.mcap", code=2)
    assert "services.parts.inputs.current_0: unknown port 'effect.battery'" in done.stderr


@pytest.mark.long
def test_model_without_multirotor_effects_is_rejected(folder: Path) -> None:
    scene = folder / "gyrostat.toml"
    gyrostat = Path("lapwing/scenes/gyrostat_attitude.toml").resolve().read_text()
    scene.write_text(gyrostat + PARTS.format(outputs=SUPPLY, inputs="", start=FULL_PACK))
    assert_rejected(
        run_command("run", scene, "--allow-code", "--log", folder / "x.mcap"),
        "the scene has no effect battery",
    )


def test_batch_without_fmus_rejects_scene(folder: Path) -> None:
    with pytest.raises(SceneError, match="batches step the plant without FMUs"):
        BatchSimulator(scene_with(folder, SUPPLY), 2)
