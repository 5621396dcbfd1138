import numpy as np
import pytest
from effects_helpers import rotation_of

from lapwing.dynamics import effects
from lapwing.dynamics.effects.h_force import h_force


def test_force_is_sum_over_rotors(drone, situation, rotors):
    """Each rotor contributes -rho c w (v + omega x r) in its plane, at r."""
    lifted = drone.model_copy(
        update={
            "rotors": drone.rotors.model_copy(
                update={"position": tuple((x, y, 0.1) for x, y, _ in drone.rotors.position)}
            )
        }
    )
    (e,) = effects.from_scene({"h_force": {"coefficient": 1e-4}}, lifted)
    speed, omega = np.array([300.0, 250, 320, 280]), np.array([0.3, -0.5, 0.8])
    s = situation(velocity=(6, -2, 1), wind=(1, 1, 0), turn=(0.1, 0.2, -0.4), omega=omega, speed=speed)
    v = rotation_of(s).T @ np.array([5.0, -3, 1])
    force, torque = np.zeros(3), np.zeros(3)
    for w, r in zip(speed, lifted.rotors.position, strict=True):
        f = -1.2 * 1e-4 * w * (v + np.cross(omega, r)) * [1, 1, 0]
        force, torque = force + f, torque + np.cross(r, f)
    result = h_force.py_func(e, (), s, rotors())
    assert result[0] == pytest.approx(force, rel=1e-12)
    assert result[1] == pytest.approx(torque, rel=1e-12)


def test_default_coefficient_is_h_force_of_blade_element_theory(drone):
    """C_H = sigma c_d mu / 4, with thrust-coefficient scaling rho A (w R)^2."""
    (e,) = effects.from_scene({"h_force": {}}, drone)
    radius, chord = 0.2794, 0.5588 / 5
    solidity = 2 * chord / (np.pi * radius)
    drag = 0.015 + np.pi * 5 * 6.11**2 / 0.83 * (0.85 * np.arctan(7.4 / (np.pi * 22)) / (np.pi * 5 + 6.11)) ** 2
    expected = np.pi * radius**2 * radius**2 * solidity * drag / 4 / radius
    assert e.coefficient == pytest.approx(expected, rel=1e-4)
