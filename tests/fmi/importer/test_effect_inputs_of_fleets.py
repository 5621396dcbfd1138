"""Named inputs of effects in fleets."""

from pathlib import Path

import numpy as np
import pytest
from effect_fmu import write_effect_fmu

pytest.importorskip("fmpy")

from lapwing import read_log
from tests.commands import assert_rejected, run_command

SCENES = Path("lapwing/scenes").resolve()
WIND = """
[vehicle.services.parts]
fmu = "parts.fmu"
start = {{ wind = {wind}, winding = 1.0 }}
[vehicle.services.parts.outputs]
"effect.wind_constant.velocity.0" = "wind_x"

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
