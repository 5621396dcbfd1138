"""Airframe files: rejected files and error messages."""

from pathlib import Path

import pytest

from lapwing.dynamics.vehicles.airframe import load_airframe

DRONE = Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml"


def test_delivery_drone_loads():
    drone = load_airframe(DRONE)
    assert drone.mass.total == pytest.approx(8.0 + 2.0 + 4 * 5.6e-3)
    assert len(drone.rotors.position) == 4


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("total = 10.0224", "total = -1.0", "mass.total: expected a number above 0 [kg], got -1.0"),
        ("total = 10.0224", "weight = 1.0", "mass.weight: unknown key 'weight'; expected one of centre, inertia, "),
        ("blades = 2 ", 'blades = "two" ', "propeller.blades"),
        ("[0.27, 0.26, 0.42]", "[0.1, 0.1, 0.42]", "triangle"),
        ("[0.27, 0.26, 0.42]", "[1e-6, 1e-6, 1e-6]", "mass.inertia: expected at least 0.0099 m"),
        (
            'spin_direction = ["cw", "ccw", "cw", "ccw"]',
            'spin_direction = ["cw", "ccw", "left", "ccw"]',
            "rotors.spin_direction",
        ),
        ("[motor]", "[engine]", "engine: unknown key 'engine'"),
        ("[motor]", "[motor", "not valid TOML"),
    ],
)
def test_invalid_file_error_names_file_and_key(tmp_path, old, new, expected):
    text = DRONE.read_text()
    assert old in text
    path = tmp_path / "vehicle.toml"
    path.write_text(text.replace(old, new))
    with pytest.raises(ValueError) as error:
        load_airframe(path)
    message = str(error.value)
    assert "\n" not in message
    assert message.startswith(str(path))
    assert expected in message


def test_missing_file_is_rejected(tmp_path):
    with pytest.raises(ValueError, match=r"none.toml: cannot be read"):
        load_airframe(tmp_path / "none.toml")
