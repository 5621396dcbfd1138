"""Files of effects, read when the scene is loaded."""

import math
from pathlib import Path

import pytest

from lapwing.cosim.scene import SceneError
from lapwing.services.common.schemas.vehicle_schema import rotor_constants
from lapwing.services.scene_resolver import load

TABLE = '[effects.rotor_table]\nfile = "prop.txt"'


@pytest.fixture
def path(tmp_path):
    result = tmp_path / "table.toml"
    result.write_text(Path("lapwing/scenes/hover.toml").read_text().replace("[effects.rotor_thrust]", TABLE))
    return result


def test_rotor_constants_come_from_table(path):
    path.with_name("prop.txt").write_text("J CT CP\n0.0 0.10 0.04\n0.2 0.08 0.04\n")
    scene = load(path)
    path.with_name("prop.txt").unlink()
    result = rotor_constants(scene)
    assert result.thrust == pytest.approx(0.1 * 0.5588**4 / (4 * math.pi**2))
    assert result.with_density


def test_missing_or_incomplete_table_is_rejected(path):
    with pytest.raises(SceneError, match=r"effects.rotor_table.file: .*prop.txt: no such file"):
        load(path)
    path.with_name("prop.txt").write_text("J CT CP\n0.0 0.10 0.04\n0.2 0.08\n")
    with pytest.raises(SceneError, match=r"effects.rotor_table.file: expected 3 as its first line, got line 3|line 3"):
        load(path)
