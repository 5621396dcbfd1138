"""Ground forces on the feet: Newton's second law in the recorded flight, and equilibrium at rest."""

import numpy as np
import pytest

import lapwing
from lapwing.cosim.scene import SceneError
from lapwing.services.scene_resolver import load, resolve

G = 9.80665
ASKED = {"rates.contact_forces": 250}
STANDING = {
    "autopilot.accept_commands": True,
    "autopilot.follow_trajectory": False,
    "run.duration": 1.0,
    **ASKED,
}  # never armed
CALM_MISSION = {  # the plant of the delivery mission (tests/combinations.py) without its wind
    "effects.air_density": {},
    "effects.gyroscopic_torque": {},
    "effects.random_wind_force": {"mean": [0.0, 0.0, 0.0], "sigma": 0.0},
}


def up_of_body(orientation):
    """Return body z in world coordinates, shape (n, 3), of quaternions x, y, z, w."""
    x, y, z, w = orientation.T
    return np.column_stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])


def force_residual(flight):
    """Return thrust, weight and foot forces minus mass times acceleration [N], shape (n, 3)."""
    truth, reported, mass = (
        flight.truth,
        flight.topic("contact_forces"),
        flight.origin.scene["airframe"]["mass"]["total"],
    )
    assert np.array_equal(reported.times, truth.times)
    thrust = truth.rotor_thrust.sum(axis=1)[:, None] * up_of_body(truth.orientation)
    weight = np.array([0.0, 0.0, -mass * G])
    return mass * truth.acceleration - thrust - weight - reported.force.sum(axis=1)


@pytest.mark.long
@pytest.mark.parametrize("friction", ["stick_slip", "regularised"])
def test_forces_sum_to_mass_times_acceleration(friction):
    """The flight includes bounces at the landing, with forces above the weight."""
    flight = lapwing.fly("hover", {**ASKED, "effects.ground_contact.friction": friction})
    force = flight.topic("contact_forces").force
    assert abs(force_residual(flight)).max() < 1e-6
    assert np.ptp(force[:, :, 2].sum(axis=1)) > 50.0
    airborne = ~flight.truth.ground_contact
    assert airborne.any()
    assert not force[airborne].any()


def test_each_foot_carries_quarter_at_rest():
    flight = lapwing.fly("hover", STANDING)
    reported, mass = flight.topic("contact_forces"), flight.origin.scene["airframe"]["mass"]["total"]
    feet = len(flight.origin.scene["airframe"]["contact"]["feet"])
    still = reported.force[25:225]
    assert still.sum(axis=1) == pytest.approx(np.tile([0.0, 0.0, mass * G], (200, 1)), abs=1e-6)
    assert still[:, :feet, 2] == pytest.approx(mass * G / feet, rel=1e-6)
    assert not still[:, feet:].any()  # the hull is in the air
    assert reported.position[100, :feet, 2] == pytest.approx(0.0, abs=1e-4)


@pytest.mark.long
def test_on_slope_friction_and_normal_forces_make_weight():
    flight = lapwing.fly("hover", {**STANDING, "environment.terrain.slope": [0.2, 0.0]})
    reported, mass = flight.topic("contact_forces"), flight.origin.scene["airframe"]["mass"]["total"]
    assert reported.force[100].sum(axis=0) == pytest.approx([0.0, 0.0, mass * G], abs=1e-3)
    lower, upper = reported.force[100, [1, 2], 2].sum(), reported.force[100, [0, 3], 2].sum()
    assert lower > 1.05 * upper  # the centre of mass is nearer to the lower feet


@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "model", "effects"), [("hover", "multibody", CALM_MISSION), ("slung_load", "slung_load", {})]
)
def test_foot_forces_of_several_bodies_carry_weight(scene, model, effects):
    flight = lapwing.fly(scene, {**STANDING, **effects, "vehicle.model": model, "run.duration": 0.2})
    mass = flight.origin.scene["airframe"]["mass"]["total"]
    assert flight.topic("contact_forces").force[10].sum(axis=0)[2] == pytest.approx(mass * G, rel=1e-3)


def test_contact_topic_is_optional_and_does_not_change_flight():
    requested, plain = lapwing.fly("hover", ASKED), lapwing.fly("hover")
    assert not plain.has("contact_forces")
    assert np.array_equal(requested.truth.position, plain.truth.position)


@pytest.mark.parametrize("scene", ["gyrostat_chaotic", "cooperative_load", "os4_motors"])
def test_contact_topic_needs_contact_effect(scene):
    with pytest.raises(
        SceneError, match=r"rates.contact_forces: no effect of the scene computes contact forces; expected a"
    ):
        resolve(load(scene, {"rates.contact_forces": 50}))


def test_contact_rate_must_divide_communication_rate():
    with pytest.raises(SceneError, match=r"rates.contact_forces: expected a rate that divides communication.rate"):
        load("hover", {"rates.contact_forces": 70})
