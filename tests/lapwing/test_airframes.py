"""Each shipped airframe flies its scene with its gains and lands, or `check` reports that it cannot."""

import numpy as np
import pytest

import lapwing
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.services.common.schemas.run_schema import SHIPPED

# worst RMSE of x, y [m]
SCENES = {"quad_x": 0.03, "racer_250": 0.3, "os4_hover": 0.05, "hexacopter": 0.05, "hexacopter_tilted": 0.05}


@pytest.mark.parametrize("path", sorted((SHIPPED / "vehicles").glob("*.toml")), ids=lambda path: path.stem)
def test_airframe_is_valid_and_names_its_sources(path):
    assert load_airframe(path).mass.total > 0.0
    text = path.read_text()
    assert '"chosen"' in text or "All figures are chosen" in text


@pytest.mark.long
@pytest.mark.parametrize("scene", SCENES)
def test_airframe_flies_and_lands(scene):
    flight = lapwing.fly(scene)
    assert flight.landed
    assert max(flight.rmse["x"], flight.rmse["y"]) < SCENES[scene]
    assert np.degrees(flight.rmse["yaw"]) < 1.0


@pytest.mark.long
def test_hexacopter_without_rotor_holds_height_and_heading():
    flight = lapwing.fly("hexacopter", {"effects.rotor_damage.time": 7.0, "run.duration": 10.0})
    after = flight.truth.times > 7.5
    assert np.abs(flight.truth.position[after, 2] - flight.truth.position[after, 2].mean()).max() < 0.1
    assert np.ptp(flight.actuators.thrust[flight.actuators.times > 7.5, 0]) == 0.0
