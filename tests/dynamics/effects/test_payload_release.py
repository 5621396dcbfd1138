import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects.payload_release import RELEASED, payload_release, release


def make(drone, **table):
    (e,) = effects.from_scene({"payload_release": table}, drone)
    return e


def test_mass_and_inertia_with_and_without(drone):
    e = make(drone)
    loaded, empty = payload_release.py_func(e, (0.0,), None), payload_release.py_func(e, RELEASED, None)
    assert loaded.mass == 10.0224
    assert empty.mass == pytest.approx(8.0224)
    box = 2.0 / 12 * np.array([0.13**2 + 0.23**2, 0.20**2 + 0.23**2, 0.20**2 + 0.13**2])
    assert np.subtract(loaded.inertia, empty.inertia) == pytest.approx(box)
    assert np.multiply(empty.inertia, empty.inverse_inertia) == pytest.approx(np.ones(3))


def test_payload_is_released_once_at_its_time(drone):
    e = make(drone, release_time=3.0)
    assert release.py_func(e, (0.0,), 2.999) == (0.0,)
    assert release.py_func(e, (0.0,), 3.0) == (1.0,)
    assert release.py_func(make(drone), RELEASED, 9.0) == (1.0,)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"mass": 11.0}, r"effects.payload_release.mass: expected less than the vehicle's 10.0224 kg, got 11.0"),
        ({"mass": -1.0}, r"effects.payload_release.mass: expected a number above 0 \[kg\], got -1.0"),
        ({"mass": 9.0, "size": [2.0, 2.0, 2.0]}, r"effects.payload_release: has more inertia"),
    ],
)
def test_invalid_payload_is_rejected(drone, table, message):
    with pytest.raises(ValueError, match=message):
        make(drone, **table)
