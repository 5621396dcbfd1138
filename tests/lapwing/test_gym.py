"""Gymnasium environments: its checker, single and vector environments, and controllers that solve the tasks."""

import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="Gymnasium is not installed: pip install lapwing[gym]")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import lapwing.gym  # noqa: E402

TASKS = list(lapwing.gym.TASKS)


def many(task, n=8):
    return gymnasium.make_vec(f"lapwing/{task}-v0", num_envs=n, vectorization_mode="vector_entry_point")


def steered(observed):
    """Return actions of a proportional controller: towards the target, upright, without rotation."""
    way, past, R, omega = observed[:, 0:3], observed[:, 6:9], observed[:, 9:18].reshape(-1, 3, 3), observed[:, 18:21]
    expected = np.clip(1.2 * way, -3.0, 3.0) - 1.8 * past  # [m/s^2]
    tilt = np.clip(expected[:, :2] / 9.81, -0.5, 0.5)
    up = np.column_stack([tilt, np.ones(len(tilt))])
    up /= np.linalg.norm(up, axis=1)[:, None]
    off = np.cross(R[:, :, 2], up)  # axis of the rotation in the world
    turn = 6.0 * np.einsum("nij,ni->nj", R, off) - 0.1 * omega
    thrust = expected[:, 2] / 9.81 + 1.0 / np.clip(R[:, 2, 2], 0.5, 1.0) - 1.0
    return np.clip(np.column_stack([thrust, turn[:, :2] / 6.0, -0.3 * omega[:, 2]]), -1.0, 1.0)


def fly_episode(task, n=8, seconds=8.0):
    environments = many(task, n)
    observed, _ = environments.reset(seed=3)
    total, ended = np.zeros(n), np.zeros(n, bool)
    for _ in range(round(seconds * 50)):
        observed, reward, terminated, _, _ = environments.step(steered(observed))
        total += np.where(ended, 0.0, reward)
        ended |= terminated
    return environments, observed, total, ended


@pytest.mark.long
@pytest.mark.parametrize("task", TASKS)
@pytest.mark.filterwarnings("error")
def test_env_checker_passes_without_warning(task):
    environment = gymnasium.make(f"lapwing/{task}-v0").unwrapped
    check_env(environment, skip_render_check=True)
    space = environment.observation_space
    assert np.isfinite([space.low, space.high]).all()


@pytest.mark.long
@pytest.mark.parametrize("task", TASKS)
def test_observations_stay_within_bounds_under_random_actions(task):
    environments, random = many(task, 20), np.random.default_rng(4)
    environments.reset(seed=4)
    ends = 0
    for _ in range(300):
        actions = random.uniform(-1.0, 1.0, (20, 4)) * [0.5, 3.0, 3.0, 3.0]  # clipped
        observed, _, terminated, truncated, _ = environments.step(actions)
        assert environments.observation_space.contains(observed)
        ends += terminated.sum() + truncated.sum()
    assert ends > 0


@pytest.mark.long
def test_invalid_vehicle_is_lost_and_observed_within_bounds():
    environments = many("Hover", 2)
    environments.reset(seed=1)
    environments.unwrapped.batch.restart([1], position_world=(0.0, 0.0, 5.0), omega_body=(1e9, 0.0, 0.0))
    observed, reward, terminated, *_ = environments.step(np.zeros((2, 4)))
    assert (terminated.tolist(), reward[1]) == ([False, True], -10.0)
    assert environments.observation_space.contains(observed)


def test_invalid_actions_are_rejected():
    environments = many("Hover", 2)
    environments.reset(seed=1)
    with pytest.raises(ValueError, match="actions: expected finite numbers"):
        environments.step(np.array([[0.0, 0.0, 0.0, 0.0], [0.0, np.nan, 0.0, 0.0]]))
    with pytest.raises(ValueError, match=r"actions: expected 4 numbers for each vehicle, shape \(2, 4\), got \(2, 3\)"):
        environments.step(np.zeros((2, 3)))


@pytest.mark.parametrize("task", ["Hover", "Track"])
def test_reward_equals_closed_form(task):
    environments, n = many(task, 20), 20
    environments.reset(seed=6)
    for _ in range(30):
        _, reward, terminated, *_ = environments.step(np.full((n, 4), [0.1, 0.05, 0.0, 0.1]))
    state = environments.unwrapped.batch.state
    a, height = 2.0 * np.pi / 12.0 * state.time, environments.unwrapped._ground + 5.0
    still = task == "Hover"
    place = np.stack([4.0 * np.sin(a) * (not still), 2.0 * np.sin(2 * a) * (not still), np.full(n, height)], axis=1)
    speed = np.stack([4.0 * np.cos(a), 4.0 * np.cos(2 * a), np.zeros(n)], axis=1) * (0.0 if still else np.pi / 6.0)
    away, slip, spin = (
        np.linalg.norm(v, axis=1)
        for v in (place - state.position_world, state.velocity_world - speed, state.omega_body)
    )
    assert not terminated.any()
    assert reward == pytest.approx(np.exp(-away) - 0.05 * np.tanh(slip) - 0.02 * np.tanh(spin), abs=1e-12)


def test_single_environment_equals_first_of_vector():
    environments, one = many("Hover"), gymnasium.make("lapwing/Hover-v0")
    together, _ = environments.reset(seed=9)
    alone, _ = one.reset(seed=9)
    assert environments.observation_space.contains(together)
    assert np.array_equal(together[0], alone)
    for _ in range(20):
        together, reward, *_ = environments.step(np.full((8, 4), 0.1, np.float32))
        alone, worth, *_ = one.step(np.full(4, 0.1, np.float32))
    assert np.array_equal(together[0], alone)
    assert reward[0] == worth


def test_controller_hovers():
    _, observed, total, ended = fly_episode("Hover")
    assert not ended.any()
    assert np.abs(observed[:, :3]).max() < 0.1
    assert total.min() > 250.0  # of 400


def test_trained_policy_lands_softly():
    environments = many("Land")
    observed, _ = environments.reset(seed=3)
    last = np.zeros(8)
    for _ in range(450):
        action = steered(np.column_stack([np.clip(observed[:, :3] - [0.0, 0.0, 0.4], -1.1, 1.1), observed[:, 3:]]))
        observed, reward, terminated, _, _ = environments.step(action)
        last = np.where(terminated, reward, last)
    assert last.min() > 5.0


def test_trained_policy_flies_through_gates():
    environments, _, total, ended = fly_episode("Race", seconds=12.0)
    assert not ended.any()
    assert environments.unwrapped._episodes.gates.min() >= 2
    assert total.min() > 20.0


def test_finished_episode_restarts_without_others():
    environments = many("Hover", 2)
    environments.reset(seed=1)
    for _ in range(500):
        falls = np.array([[-1.0, 0, 0, 0], [0.0, 0, 0, 0]])
        observed, reward, terminated, truncated, _ = environments.step(falls)
        if terminated[0]:
            break
    assert (terminated.tolist(), reward[0]) == ([True, False], -10.0)
    observed, reward, terminated, truncated, _ = environments.step(falls)
    assert (reward[0], terminated[0], truncated[0]) == (0.0, False, False)
    assert np.abs(observed[0, :3]).max() <= 1.5
    assert environments.unwrapped.batch.state.time[0] == 0.0 < environments.unwrapped.batch.state.time[1]


def test_unknown_task_is_rejected():
    with pytest.raises(ValueError, match="task: expected one of Hover, Track, Land, Race, got 'Swim'"):
        lapwing.gym.DroneVectorEnv(1, "Swim")


def test_make_imports_module_before_colon():
    script = 'import gymnasium; gymnasium.make("lapwing.gym:lapwing/Hover-v0")'
    subprocess.run([sys.executable, "-c", script], check=True)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])
def test_copy_continues_as_original(copied):
    original = gymnasium.make("lapwing/Hover-v0")
    original.reset(seed=3)
    action = np.array([0.1, 0.2, -0.1, 0.0])
    original.step(action)
    other = copied(original)
    assert np.array_equal(original.step(action)[0], other.step(action)[0])
    moved = other.step(-action)[0]
    assert not np.array_equal(original.step(action)[0], moved)  # the memory is its own
    assert np.array_equal(original.reset()[0], other.reset()[0])  # the next random numbers are equal


def test_seed_of_each_vehicle_equals_that_of_single_environment():
    environments, one = many("Hover"), gymnasium.make("lapwing/Hover-v0")
    seeds = [7, *range(100, 99 + environments.num_envs)]
    observations, _ = environments.reset(seed=seeds)
    assert np.array_equal(observations[0], one.reset(seed=7)[0])
    assert environments.np_random_seed == tuple(seeds)
    kept = environments.np_random[1]
    environments.reset(seed=[7, None, *seeds[2:]])
    assert environments.np_random[1] is kept
    with pytest.raises(ValueError, match=r"^seed: expected \d+ seeds, one for each vehicle, got 1$"):
        environments.reset(seed=[1])
    assert isinstance(environments.unwrapped.reset(seed=1)[0], np.ndarray)
    assert environments.np_random_seed == 1


def test_generator_of_environment_is_used():
    one = gymnasium.make("lapwing/Hover-v0").unwrapped
    first = one.reset(seed=5)[0]
    assert one.np_random_seed == 5
    one.np_random = np.random.default_rng(0)
    second = one.reset()[0]
    one.np_random = np.random.default_rng(0)
    assert np.array_equal(one.reset()[0], second)
    assert not np.array_equal(first, second)
