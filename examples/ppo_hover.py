"""Learning to hover by proximal policy optimisation (PPO of skrl, on JAX) with 256 vehicles of `lapwing.gym`.

    pip install lapwing[learn]
    python examples/ppo_hover.py [STEPS] [SEED]

Prints the mean return, final distance from the target and number of actions of whole episodes before and after the
training; the largest possible return of ten seconds (500 actions) is 500.
"""

import sys
import time

import flax.linen as nn
import gymnasium
import jax.numpy as jnp
import numpy as np
from skrl.agents.jax.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.jax import wrap_env
from skrl.memories.jax import RandomMemory
from skrl.models.jax import DeterministicMixin, GaussianMixin, Model
from skrl.resources.preprocessors.jax import RunningStandardScaler
from skrl.trainers.jax import SequentialTrainer
from skrl.utils import set_seed

import lapwing.gym  # noqa: F401 (registers the environments)

VEHICLES, EVALUATED, ROLLOUT = 256, 64, 32  # number of vehicles in training and evaluation; actions of 20 ms
INITIAL_LOG_STD = -1.0  # logarithm of the initial standard deviation of the actions
LINE = "{:6} return {:6.1f}, {:.2f} m from the target at the end, after {:.0f} actions"


class Policy(GaussianMixin, Model):
    """Policy network: mean and standard deviation of the actions of an observation."""

    def __init__(self, observation_space, action_space, **options):
        Model.__init__(self, observation_space=observation_space, action_space=action_space, **options)
        GaussianMixin.__init__(self)

    @nn.compact
    def __call__(self, inputs, role):
        """Return (mean action, logarithm of the standard deviation)."""
        x = inputs["observations"]
        for _ in range(2):
            x = nn.tanh(nn.Dense(64)(x))
        mean = nn.Dense(4, kernel_init=nn.initializers.orthogonal(0.01))(x)
        return mean, {"log_std": self.param("log_std", lambda _: INITIAL_LOG_STD * jnp.ones(4))}


class Value(DeterministicMixin, Model):
    """Value network: expected return of an observation."""

    def __init__(self, observation_space, action_space, **options):
        Model.__init__(self, observation_space=observation_space, action_space=action_space, **options)
        DeterministicMixin.__init__(self)

    @nn.compact
    def __call__(self, inputs, role):
        """Return the expected return."""
        x = inputs["observations"]
        for _ in range(2):
            x = nn.tanh(nn.Dense(64)(x))
        return nn.Dense(1)(x), {}


def create_agent(environments):
    """Return a PPO agent for these environments."""
    spaces = environments.observation_space, environments.action_space
    models = {"policy": Policy(*spaces), "value": Value(*spaces)}
    for role, model in models.items():
        model.init_state_dict(role=role)
    settings = PPO_CFG(
        rollouts=ROLLOUT,
        learning_epochs=5,
        mini_batches=8,
        learning_rate=1e-3,
        value_loss_scale=1.0,
        time_limit_bootstrap=True,
        value_preprocessor=RunningStandardScaler,
        value_preprocessor_kwargs={"size": 1},
    )
    settings.experiment.write_interval = settings.experiment.checkpoint_interval = 0
    memory = RandomMemory(memory_size=ROLLOUT, num_envs=environments.num_envs)
    return PPO(
        models=models, memory=memory, observation_space=spaces[0], action_space=spaces[1], cfg=settings
    )  # fmt: skip


def train(agent, environments, steps):
    """Train the agent for a number of steps of all vehicles."""
    SequentialTrainer(
        env=environments,
        agents=agent,
        cfg={"timesteps": steps, "headless": True, "disable_progressbar": None, "close_environment_at_exit": False},
    ).train()


def create_environments(vehicles):
    """Return a vector environment of this number of vehicles."""
    return gymnasium.make_vec("lapwing/Hover-v0", vehicles, "vector_entry_point")


def displacement_to_target(observations):
    """Return the displacement to the target [m], shape (n, 3), of observations (n, 21)."""
    return observations[:, :3]


def evaluate(agent, environments, displacement=displacement_to_target, seed=10**6):
    """Return mean return, final distance [m] and final actions of one episode of each vehicle with the mean actions."""
    observations, _ = environments.reset(seed=seed)
    n = environments.num_envs
    total, away, flight, over = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n, bool)
    while not over.all():
        _, outputs = agent.policy.act({"observations": jnp.asarray(observations)}, role="policy")
        observations, reward, terminated, truncated, _ = environments.step(np.asarray(outputs["mean_actions"]))
        total += np.where(over, 0.0, reward)
        away = np.where(over, away, np.linalg.norm(displacement(observations), axis=1))
        flight += ~over
        over |= terminated | truncated
    return total.mean(), away.mean(), flight.mean()


def main(steps=2000, seed=1):
    """Train for a number of steps of 20 ms of all vehicles. Return the results of `evaluate` before and after."""
    set_seed(seed)
    environments = wrap_env(create_environments(VEHICLES), verbose=False)
    evaluated = create_environments(EVALUATED)
    agent = create_agent(environments)
    before = evaluate(agent, evaluated)
    print(LINE.format("before", *before), flush=True)
    began, processor = time.monotonic(), time.process_time()
    train(agent, environments, steps)
    took = time.process_time() - processor
    after = evaluate(agent, evaluated)
    print(LINE.format("after", *after))
    print(f"{steps * VEHICLES} steps, {took:.0f} s of processor time, {time.monotonic() - began:.0f} s")
    return before, after


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
