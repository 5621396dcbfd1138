"""Time integration in the general engine: order, energy, four stabilisations, both coordinates, and errors."""

import numpy as np
import pytest
from multibody_angles import euler_from_quaternion, quaternion_from_euler
from multibody_energy import energy
from test_augmented import PAPER

from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.multibody.delivery_drone import delivery_drone
from lapwing.dynamics.multibody.five_bodies import BodyState, arrays, machine
from lapwing.dynamics.multibody.five_body_stabilisation import assembled_state
from lapwing.dynamics.multibody.mechanisms import drone_system, four_bars
from lapwing.dynamics.multibody.simulation import simulate

SPEEDS = (40.0, -30.0, 35.0, -45.0)


def tumbling():
    drone = delivery_drone(**PAPER)
    chassis = BodyState((0.0, 0.0, 10.0), Quaternion(0.8, 0.0, 0.6, 0.0), (1.0, 2.0, 3.0), (0.3, 0.5, -0.4))
    return drone, *arrays(assembled_state(machine(drone, (0.0, 0.0, -9.81)), chassis, (0.1, 0.2, 0.3, 0.4), SPEEDS))


@pytest.mark.long
@pytest.mark.parametrize("stabilisation", ["none", "baumgarte", "partitioning", "projection"])
def test_order_four_with_every_stabilisation(stabilisation):
    drone, q, v = tumbling()
    system = drone_system(drone, (False,) * 4)
    ends = []
    for n in (20, 40, 640):
        motion = simulate(system, q, v, 0.1 / n, n, stabilisation, record_every=n)
        ends.append(np.hstack([np.abs(motion.configuration[-1]), motion.velocity[-1]]))
    order = np.log2(np.abs(ends[0] - ends[2]).max() / np.abs(ends[1] - ends[2]).max())
    assert order > 3.6, order


@pytest.mark.parametrize("stabilisation", ["partitioning", "projection"])
@pytest.mark.parametrize("driven", [True, False])
def test_euler_and_quaternion_coordinates_fly_alike(stabilisation, driven):
    drone, q, v = tumbling()
    system = drone_system(drone, (driven,) * 4)
    drive = np.array([[s, 3.0] for s in SPEEDS]) if driven else None
    wrench = np.zeros((5, 6))
    wrench[0] = [1.0, 2.0, 95.0, 0.1, -0.2, 0.1]
    angles, rates = euler_from_quaternion(q, v)
    n = 400
    first = simulate(system, q, v, 0.2 / n, n, stabilisation, wrench=wrench, drive=drive, record_every=n)
    second = simulate(system, angles, rates, 0.2 / n, n, stabilisation, wrench=wrench, drive=drive, record_every=n)
    back, twist = quaternion_from_euler(second.configuration[-1], second.velocity[-1])
    np.testing.assert_allclose(back[:, :3], first.configuration[-1, :, :3], atol=1e-7)
    np.testing.assert_allclose(np.abs(back[:, 3:]), np.abs(first.configuration[-1, :, 3:]), atol=1e-6)
    np.testing.assert_allclose(twist, first.velocity[-1], atol=1e-4)
    assert max(first.position_defect[-1], second.position_defect[-1]) < 1e-12
    assert max(first.velocity_defect[-1], second.velocity_defect[-1]) < 1e-10


def test_energy_equals_sum_over_bodies():
    system, q, v = four_bars(2, speed=1.0)
    kinetic, potential = energy(system, q, v)
    assert kinetic == pytest.approx(0.5 * (3.0 / 3.0 + 2.0))  # three cranks about their ends, two couplers
    assert potential == pytest.approx(9.81 * (3 * 0.5 + 2))


def test_invalid_arguments_are_rejected():
    system, q, v = four_bars()
    with pytest.raises(ValueError, match="unknown stabilisation 'glue': choose one of none, partitioning"):
        simulate(system, q, v, 1e-3, 1, "glue")
    with pytest.raises(ValueError, match="step must be positive, not 0"):
        simulate(system, q, v, 0.0, 1)
