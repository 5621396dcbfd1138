import mpmath
import pytest

from dynamics import effects
from dynamics.effects.air_density import air_density, tangent


def law(height, temperature=15.0):
    """The source's law in high precision."""
    kelvin = mpmath.mpf(273) + temperature
    pressure = 101325 * (1 - mpmath.mpf("0.0065") * height / kelvin) ** mpmath.mpf("5.2561")
    return float(273 * pressure / (101325 * kelvin) * mpmath.mpf("1.293"))


@pytest.mark.parametrize(("height", "bound"), [(0, 1e-14), (10, 1e-14), (500, 1e-12), (2000, 1e-10), (5000, 3e-8)])
@pytest.mark.parametrize("home", [0.0, 800.0])
def test_series_follows_the_law(drone, situation, rotors, height, bound, home):
    (e,) = effects.from_scene({"air_density": {"home_altitude": home}}, drone)
    s = situation(position=(0, 0, height))
    memory = tangent.py_func(e, e.initial_memory(), s, rotors(), (0, 0), 0, 0.004)
    assert air_density.py_func(e, memory, s, s.air).density == pytest.approx(law(home + height), rel=bound)


def test_tangent_holds_over_an_interval(drone, situation, rotors):
    """20 m/s of climb for 4 ms are 8 cm."""
    (e,) = effects.from_scene({"air_density": {}}, drone)
    s = situation(position=(0, 0, 100.0))
    memory = tangent.py_func(e, e.initial_memory(), s, rotors(), (0, 0), 0, 0.004)
    later = situation(position=(0, 0, 100.08))
    assert air_density.py_func(e, memory, later, later.air).density == pytest.approx(law(100.08), rel=1e-10)


def test_sea_level_and_published_standard_atmosphere(drone):
    (e,) = effects.from_scene({"air_density": {}}, drone)
    assert e.initial_memory()[0] == pytest.approx(1.2257, abs=1e-4)
    # the source keeps the ground's temperature aloft: at 1 km 2 % under the standard atmosphere's 1.1116 kg/m^3
    assert law(1000.0) == pytest.approx(1.1116 * (288.15 - 6.5) / 288.15, rel=2e-3)
