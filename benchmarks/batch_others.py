"""`lapwing.BatchSimulator` compared with mujoco.rollout and Crazyflow on the CPU: speed and accuracy.

    python -m benchmarks.batch_others

RK4 steps of 1 ms per second of processor time (independent of other work and of the number of threads), the median of
repeats, each simulator in a separate process. The error is that of the attitude after half a second of
tumbling at 13 rad/s under constant commands, against the same simulator at an eighth of the step. MuJoCo flies the
delivery drone; Crazyflow flies its Crazyflie in single precision. Simulators that are not installed (extra `bench`) are
skipped.
"""

import json
import os
import subprocess
import sys
import time
from importlib.util import find_spec
from statistics import median

import numpy as np

import lapwing
from benchmarks._command import command_line
from benchmarks._targets import Row, show

N, STEPS, REPEATS, ROUNDS, FINER = 512, 100, 5, 1, 8
STEP, SECONDS = 1e-3, 0.5
HIGH, OMEGA = (0.0, 0.0, 2000.0), (10.0, -7.0, 4.0)  # [m], [rad/s]
MASS, INERTIA, HUB = 10.0224, (0.27, 0.26, 0.42), 0.35171491  # [kg, kg m^2, m] of the delivery drone
SIGNS, TORQUE = ((1, 1), (-1, 1), (-1, -1), (1, -1)), 0.02  # of the hubs; [m] reaction torque to thrust
VOLTS = 31.6


class Lapwing:
    """`lapwing.BatchSimulator` with the scene `hover`."""

    def __init__(self, n, step):
        self.batch = lapwing.BatchSimulator("hover", n, overrides=[f"solver.step={step}"])
        speed = self.batch.hover_speed
        self.batch.reset(position_world=HIGH, omega_body=OMEGA, rotor_speed=speed)
        self.volts, self.steps = np.full((n, 4), VOLTS), self.batch._core.steps

    def advance(self, steps):
        self.batch.step(motor_voltages=self.volts, ticks=steps // self.steps)

    def attitude(self):
        return self.batch.state.attitude[0]


class MuJoCo:
    """mujoco.rollout in one thread: a free body with four rotors of constant thrust."""

    def __init__(self, n, step):
        import mujoco

        sites = "".join(f'<site name="r{k}" pos="{x * HUB} {y * HUB} 0"/>' for k, (x, y) in enumerate(SIGNS))
        motors = "".join(
            f'<motor site="r{k}" gear="0 0 1 0 0 {TORQUE * x * y}" ctrlrange="0 60"/>' for k, (x, y) in enumerate(SIGNS)
        )
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{step}" integrator="RK4"><flag contact="disable"/></option><worldbody><body>'
            f'<freejoint/><inertial pos="0 0 0" mass="{MASS}" diaginertia="{" ".join(map(str, INERTIA))}"/>{sites}'
            f"</body></worldbody><actuator>{motors}</actuator></mujoco>"
        )
        self.data, spec = mujoco.MjData(self.model), mujoco.mjtState.mjSTATE_FULLPHYSICS
        self.data.qpos[:3], self.data.qvel[3:] = HIGH, OMEGA
        start = np.zeros(mujoco.mj_stateSize(self.model, spec))
        mujoco.mj_getState(self.model, self.data, start, spec)
        self.states = np.tile(start, (n, 1))

    def advance(self, steps):
        from mujoco import rollout

        control = np.full((len(self.states), steps, 4), MASS * 9.81 / 4)
        result, _ = rollout.rollout(self.model, self.data, self.states, control)
        self.states = result[:, -1].copy()

    def attitude(self):
        return self.states[0, 4:8]  # after time and position


class Crazyflow:
    """Crazyflow's Crazyflie from first principles, compiled by JAX for the CPU."""

    def __init__(self, n, step):
        import jax.numpy as jnp
        from crazyflow.control import Control
        from crazyflow.sim import Sim
        from crazyflow.sim.sim import Dynamics, Integrator

        options = {"dynamics": Dynamics.first_principles, "control": Control.rotor_vel, "integrator": Integrator.rk4}
        self.sim = Sim(n_worlds=n, freq=round(1.0 / step), **options)
        mass, (_, _, thrust) = float(self.sim.data.params.mass[0]), self.sim.data.params.rpm2thrust[0]
        command = jnp.full((n, 1, 4), np.sqrt(mass * 9.81 / 4 / float(thrust)))
        states = self.sim.data.states
        states = states.replace(
            pos=jnp.broadcast_to(jnp.array(HIGH), states.pos.shape),
            ang_vel=jnp.broadcast_to(jnp.array(OMEGA), states.ang_vel.shape),
            rotor_vel=command,
        )
        self.sim.data = self.sim.data.replace(states=states)
        self.sim.rotor_vel_control(command)

    def advance(self, steps):
        self.sim.step(steps)
        self.sim.data.states.pos.block_until_ready()

    def attitude(self):
        return np.asarray(self.sim.data.states.quat[0, 0], float)


CONTESTANTS = {"lapwing": Lapwing, "mujoco": MuJoCo, "crazyflow": Crazyflow}  # by required package


def main() -> list[Row]:
    installed = [name for name in CONTESTANTS if find_spec(name)]
    for name in CONTESTANTS.keys() - set(installed):
        print(f"{name} is not installed: pip install 'lapwing[bench]'")
    measured = {name: [measure_in_process(name) for _ in range(ROUNDS)] for name in installed}
    rates = {name: median(rate for rate, _ in result) for name, result in measured.items()}
    print(f"{'':12}{'10^6 steps/s a core':>20}{'attitude error':>16}")
    for name in installed:
        print(f"{name:12}{1e-6 * rates[name]:20.2f}{measured[name][0][1]:16.1e}")
    result = [
        Row(f"batch to {name}, steps a core", rates["lapwing"] / rates[name], "", 3.0, True) for name in installed[1:]
    ]
    return show(result)


def measure_in_process(name):
    """Return (steps per second of processor time, error) of a simulator in a separate process."""
    environment = {**os.environ, "SCIPY_ARRAY_API": "1"}  # Crazyflow needs it before SciPy is imported
    code = f"from benchmarks import batch_others as b; print(b.json.dumps(b.measure(b.CONTESTANTS[{name!r}])))"
    command = [sys.executable, "-W", "ignore", "-c", code]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def measure(contestant):
    """Return (steps per second of processor time, error)."""
    one, rates = contestant(N, STEP), []
    one.advance(STEPS)
    for _ in range(REPEATS):
        began = time.process_time()
        one.advance(STEPS)
        rates.append(N * STEPS / (time.process_time() - began))
    return median(rates), error(contestant)


def error(contestant):
    """Return the largest difference of the quaternion after tumbling from that of a finer step."""
    ends = []
    for finer in (1, FINER):
        one = contestant(2, STEP / finer)
        one.advance(round(SECONDS / STEP) * finer)
        ends.append(one.attitude())
    return float(min(np.abs(ends[0] - ends[1]).max(), np.abs(ends[0] + ends[1]).max()))


if __name__ == "__main__":
    command_line(main)
