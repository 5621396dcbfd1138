"""Named inputs of effects in fleets, and of a Thevenin battery and motors with inductance."""

from pathlib import Path

import numpy as np
import pytest
from effect_fmu import write_effect_fmu

pytest.importorskip("fmpy")

from lapwing import read_log
from tests.combinations import NIGHTLY
from tests.commands import assert_rejected, run_command

SCENES = Path("lapwing/scenes").resolve()
WIND = """
[vehicle.services.parts]
fmu = "parts.fmu"
start = {{ wind = {wind}, winding = 1.0 }}
[vehicle.services.parts.outputs]
"effect.wind_constant.velocity.0" = "wind_x"

"""
BATTERY = """
[effects.battery_thevenin]
[effects.dc_motor]
inductance = 1e-5
[services.parts]
fmu = "parts.fmu"
start = { open_circuit = 44.0, resistance = 0.004, winding = 1.0 }
[services.parts.inputs]
current_0 = "truth.motor_current.0"
current_1 = "truth.motor_current.1"
current_2 = "truth.motor_current.2"
current_3 = "truth.motor_current.3"
[services.parts.outputs]
"effect.battery_thevenin.voltage" = "supply"
"""


def fly(scene: Path, log: Path) -> None:
    options = ["--allow-code", "--mode", "single-process", "--set", "run.duration=0.4", "--set", "success.require=[]"]
    run_command("run", scene, "--log", log, *options, code=0)


@pytest.mark.long
def test_vehicles_of_fleet_have_winds_of_own_fmus(tmp_path: Path) -> None:
    write_effect_fmu(tmp_path / "parts.fmu")
    scene, log = tmp_path / "fleet.toml", tmp_path / "fleet.mcap"
    text = (SCENES / "fleet.toml").read_text()
    for follower, wind in (("right", 3.0), ("scout", -2.0)):  # the table belongs to the vehicle before
        entry = f'[[vehicle]]\nname = "{follower}"'
        text = text.replace(entry, WIND.format(wind=wind) + entry)
    scene.write_text(text)
    fly(scene, log)
    for vehicle, wind in (("left", 3.0), ("right", -2.0), ("scout", 1.0)):
        winds = read_log(log).fleet[vehicle].wind
        assert np.array_equal(winds[1:], np.tile([wind, 0.5, 0.0], (len(winds) - 1, 1))), vehicle
    assert_rejected(run_command("resimulate", log), "has FMUs, machine code of their authors")


@pytest.mark.long
@NIGHTLY
def test_thevenin_battery_of_fmu_supplies_motors_with_inductance(tmp_path: Path) -> None:
    write_effect_fmu(tmp_path / "parts.fmu")
    scene, log = tmp_path / "battery.toml", tmp_path / "battery.mcap"
    scene.write_text((SCENES / "hover.toml").read_text() + BATTERY)
    fly(scene, log)
    flight = read_log(log)
    supply = flight.topic("custom_sensor/effect_battery_thevenin").values[:, 0]
    current = flight.truth.motor_current.sum(axis=1)
    assert current.max() > 1.0
    assert supply == pytest.approx(44.0 - 0.004 * current, abs=1e-9)
    assert (flight.truth.motor_voltage[1:].max(axis=1) <= supply[:-1]).all()
