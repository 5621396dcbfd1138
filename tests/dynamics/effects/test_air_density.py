import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.atmosphere import Atmosphere, density
from lapwing.dynamics.effects.air_density import air_density, tangent
from lapwing.dynamics.environment import STANDARD, Environment
from lapwing.dynamics.geodesy import Home

pytestmark = pytest.mark.usefixtures("uncompiled")

HIGH = Environment(home=Home(46.0, 11.0, 800.0), atmosphere=Atmosphere(100_000.0, -10.0))


@pytest.mark.parametrize("around", [STANDARD, HIGH])
@pytest.mark.parametrize("height", [0.0, 100.0, 3000.0, 12_000.0])
def test_density_equals_standard_atmosphere(drone, situation, rotors, around, height):
    (e,) = effects.from_scene({"air_density": {}}, drone, around)
    memory = tangent.py_func(
        e, e.initial_discrete_state(), situation(position=(0, 0, height)), rotors(), (0, 0), 0, 0.004
    )
    for above, bound in ((0.0, 1e-13), (0.08, 1e-10)):  # 20 m/s of climb for 4 ms
        s = situation(position=(0, 0, height + above))
        expected = density(around.atmosphere, around.home.height + height + above)
        assert air_density.py_func(e, memory, s, s.air).density == pytest.approx(expected, rel=bound)


def test_density_starts_at_home_altitude(drone):
    (e,) = effects.from_scene({"air_density": {}}, drone, HIGH)
    assert e.initial_discrete_state()[0] == density(HIGH.atmosphere, 800.0)
