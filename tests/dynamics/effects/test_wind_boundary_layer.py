import math

import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects.wind_boundary_layer import wind_boundary_layer
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.terrain import LEVEL, relief

TABLE = {"speed": 8.0, "height": 10.0, "roughness": 0.1, "direction_to": math.pi / 2}


HILL, ROOF = relief(slope=(0.1, 0.0)), relief(boxes=[(0.0, 0.0, 500.0, 500.0, 0.0, 3.0)])


@pytest.mark.parametrize(("terrain", "ground"), [(LEVEL, 0.0), (HILL, 2.0), (ROOF, 3.0)])
def test_wind_is_logarithmic_in_height_over_ground(drone, situation, terrain, ground):
    (e,) = effects.from_scene({"wind_boundary_layer": TABLE}, drone, Environment(terrain=terrain))

    def wind(height):
        s = situation(position=(20.0, 5.0, ground + height))
        return wind_boundary_layer.py_func(e, (), s, s.air).wind_world

    assert wind(10.0) == pytest.approx((0.0, 8.0, 0.0), abs=1e-9)
    assert wind(0.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert wind(-1.0)[1] == 0.0
    # friction velocity over von Karman's constant at every height: u = a ln(1 + z / z0)
    for height in (0.5, 3.0, 60.0):
        assert wind(height)[1] / math.log1p(height / 0.1) == pytest.approx(8.0 / math.log(101.0), rel=1e-6)
