"""`vehicle.model = "multibody"`: what a scene may say of it; and the mission begins as with the reduced model."""

from pathlib import Path

import pytest

from messages import Actuators, header
from messages.topics import BODIES, TRUTH
from services.scene import SceneError, load
from services.table import lockstep_services

MISSION = Path(__file__).parents[3] / "scenes/delivery_mission.toml"
FLOWN = "vehicle.model=multibody"


def lifted(overrides):
    """(truth, bodies) after 0.2 s at full voltage."""
    plant = lockstep_services(load(MISSION, overrides))["plant"]
    full = Actuators(header(0, "drone1"), motor_voltage=(44.4,) * 4)
    for tick in range(51):
        said = dict(plant.step(tick, full, None))
    return said[TRUTH], said.get(BODIES)


def test_it_rises_as_the_reduced_model_does():
    calm = ["effects.wind_random.mean=[0.0, 0.0, 0.0]", "effects.wind_random.sigma=0.0"]
    one, _ = lifted(calm)
    several, bodies = lifted([FLOWN, *calm])
    assert several.pose.position.z == pytest.approx(one.pose.position.z, abs=1e-6)
    assert several.rotor_speed == pytest.approx(one.rotor_speed, rel=1e-3)
    assert list(bodies.name) == ["chassis", "propeller1", "propeller2", "propeller3", "propeller4"]
    # hinges pull the chassis up with the thrust, less what the propellers' own weight and rise take
    assert sum(f.z for f in bodies.force[1:]) == pytest.approx(-bodies.force[0].z)
    assert 0.99 * sum(several.rotor_thrust) < bodies.force[0].z < sum(several.rotor_thrust)


WRONG = {
    "a table for nobody": (
        [],
        "multibody.drive=speed",
        'the model reduced knows no such table; set vehicle.model = "mul',
    ),
    "unknown coordinates": ([FLOWN], "multibody.coordinates=so3", "multibody.coordinates: expected"),
    "a long step": (
        [FLOWN],
        "solver.step=0.004",
        "solver.step: propellers turn at up to 465 rad/s: take at most 0.001 s",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_scene_is_refused_with_its_key(name):
    before, override, message = WRONG[name]
    with pytest.raises(SceneError) as error:
        load(MISSION, [*before, override])
    assert message in str(error.value)
