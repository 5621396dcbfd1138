"""Fixtures for tests of a single effect."""

from pathlib import Path

import pytest
from scipy.spatial.transform import Rotation

from lapwing.dynamics.effects._types import Air, EffectInputs, Motion, Rotors
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe

AIRFRAME = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")


@pytest.fixture(scope="session")
def drone():
    return AIRFRAME


@pytest.fixture(scope="session")
def situation():
    """Build a Situation: (position, velocity, omega, rotation vector, rotor speeds, t, density, wind)."""

    def build(position=(0, 0, 10), velocity=(0, 0, 0), omega=(0, 0, 0), turn=(0, 0, 0), speed=(300.0,) * 4, t=0.0,
              density=1.2, wind=(0, 0, 0)):  # fmt: skip
        p = multirotor.parameters(AIRFRAME)
        rotation = Rotation.from_rotvec(turn)
        attitude = Quaternion(*map(float, rotation.as_quat(scalar_first=True)))

        def vector(v):
            return tuple(map(float, v))

        motion = Motion(vector(position), attitude, vector(velocity), vector(omega), vector(speed))
        R = tuple(map(float, rotation.as_matrix().ravel()))
        return EffectInputs(float(t), motion, R, p.body, p.layout, Air(float(density), vector(wind)), (0.0,) * 3)

    return build


@pytest.fixture(scope="session")
def rotors():
    """Build Rotors: four equal loads, accelerations, currents and voltages."""

    def build(thrust=25.0, torque=1.0, acceleration=(0.0,) * 4, current=10.0, voltage=32.0):
        return Rotors(
            (thrust,) * 4, (torque,) * 4, tuple(acceleration), (current,) * 4, (voltage,) * 4, (current * voltage,) * 4
        )

    return build
