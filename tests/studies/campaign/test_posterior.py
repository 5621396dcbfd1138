"""Vehicles drawn from estimated parameters: moments, correlations, and the file that holds them."""

import numpy as np
import pytest

from lapwing.cosim.scene.toml_text import dump
from lapwing.services.common.schemas.vehicle_schema import VehicleAirframe
from lapwing.services.scene_resolver import load_one
from lapwing.studies.campaign.distributions import normal, parse
from lapwing.studies.campaign.plan import plan
from lapwing.studies.campaign.posterior import posterior, table

SCENE = "crazyflie_21"
KEYS = {
    "effects.rotor_quadratic.thrust_constant": "lognormal",
    "airframe.motor.time_constant": "lognormal",
    "effects.body_wrench.force.0": "normal",
}
MEAN = np.array([1.75e-8, 0.056, -1e-3])
SPREAD = np.array([2e-9, 0.02, 5e-3])
CORRELATIONS = np.array([[1.0, 0.8, -0.5], [0.8, 1.0, -0.2], [-0.5, -0.2, 1.0]])
COVARIANCE = CORRELATIONS * np.outer(SPREAD, SPREAD)


def written(path, covariance=COVARIANCE):
    """Write an airframe with the posterior of the first keys, as many as the covariance has rows."""
    frame = load_one(SCENE, ())[VehicleAirframe].model_dump(mode="json", exclude_none=True)
    count = len(covariance)
    path.write_text(dump(frame | {"posterior": table(dict(list(KEYS.items())[:count]), MEAN[:count], covariance)}))
    return path


def drawn(vary, runs=4000, design="random"):
    values = plan(SCENE, (), runs, 1, vary, design=design).values
    return np.array([[values(run)[key] for key in KEYS] for run in range(runs)])


@pytest.mark.parametrize("design", ["random", "sobol"])
def test_drawn_vehicles_have_mean_and_covariance_of_estimates(tmp_path, design):
    values = drawn(posterior(written(tmp_path / "mine.toml")), design=design)
    assert np.abs((values.mean(axis=0) - MEAN) / SPREAD).max() < 0.08
    assert values.std(axis=0) == pytest.approx(SPREAD, rel=0.06)
    assert np.corrcoef(values.T) == pytest.approx(CORRELATIONS, abs=0.05)
    assert (values[:, :2] > 0.0).all()


def test_distributions_are_texts_of_manifest(tmp_path):
    for distribution in posterior(written(tmp_path / "mine.toml")).values():
        assert parse(str(distribution)) == distribution


def test_correlated_key_needs_the_others(tmp_path):
    vary = posterior(written(tmp_path / "mine.toml"))
    del vary["airframe.motor.time_constant"]
    with pytest.raises(ValueError, match=r"is correlated with airframe\.motor\.time_constant, which does not vary"):
        plan(SCENE, (), 2, 1, vary)


def test_key_without_correlations_draws_same_values_as_in_single_distribution(tmp_path):
    """The first key keeps its number; so a posterior and a single distribution can be compared."""
    key = next(iter(KEYS))
    alone = plan(SCENE, (), 5, 1, {key: normal(0.0, 1.0)})
    joint = plan(SCENE, (), 5, 1, posterior(written(tmp_path / "mine.toml", np.diag(SPREAD**2))))
    order = [np.argsort([p.values(run)[key] for run in range(5)]).tolist() for p in (alone, joint)]
    assert order[0] == order[1]


def test_perfectly_correlated_keys_stay_on_their_line(tmp_path):
    """Rounding makes an eigenvalue of such a covariance negative."""
    values = drawn(posterior(written(tmp_path / "mine.toml", np.outer(SPREAD, SPREAD) * (1.0 + 1e-9))), 200)
    assert np.corrcoef(np.log(values[:, 0]), values[:, 2])[0, 1] > 0.99


def test_airframe_without_estimates_is_refused(tmp_path):
    path = tmp_path / "plain.toml"
    path.write_text(dump(load_one(SCENE, ())[VehicleAirframe].model_dump(mode="json", exclude_none=True)))
    with pytest.raises(ValueError, match=r"plain\.toml: no estimates in \[posterior\]; expected a file that"):
        posterior(path)


def test_scene_with_identified_airframe_is_that_without_posterior(tmp_path):
    scene = load_one(SCENE, {"vehicle.airframe": str(written(tmp_path / "mine.toml"))})
    assert scene[VehicleAirframe].mass == load_one(SCENE, ())[VehicleAirframe].mass
    assert "posterior" not in scene[VehicleAirframe].model_dump()


@pytest.mark.long
def test_environments_are_drawn_vehicles(tmp_path):
    pytest.importorskip("gymnasium")
    from lapwing.gym import DroneVectorEnv

    vary = posterior(written(tmp_path / "mine.toml", COVARIANCE[:2, :2]))
    environments = DroneVectorEnv(4, scene=SCENE, vary=vary)
    environments.reset(seed=1)
    environments.step(np.full((4, 4), 0.5, np.float32))
    assert len(set(environments.batch.state.rotor_speed[:, 0])) == 4
