import math

import numpy as np
import pytest
from closed_loop import AIRFRAME, TICK
from scipy.signal import cont2discrete

from lapwing.services.autopilot.controller_parameters import build
from lapwing.services.autopilot.gains import load
from lapwing.services.autopilot.margins import FREQUENCIES, margins, open_loops


def test_integrator_with_delay_is_closed_form():
    k, delay = 5.0, 0.05
    s = 1j * FREQUENCIES
    m = margins(k / s * np.exp(-delay * s))
    assert m.crossover == pytest.approx(k, rel=1e-3)
    assert m.phase == pytest.approx(math.pi / 2.0 - k * delay, rel=1e-3)
    assert m.gain == pytest.approx(math.pi / (2.0 * k * delay), rel=1e-2)
    assert m.reduction == 0.0


def test_pid_on_double_integrator_has_minimum_gain():
    p, i, d = 4.0, 2.0, 3.0
    s = 1j * FREQUENCIES
    m = margins((p + i / s + d * s) / s**2)
    assert m.gain == math.inf
    assert m.reduction == pytest.approx(i / (p * d), rel=1e-2)  # Routh on s^3 + k d s^2 + k p s + k i


@pytest.mark.parametrize(("gain", "crossover"), [(1e9, math.inf), (1e-9, 0.0)])
def test_loop_without_unity_gain_has_no_crossover(gain, crossover):
    s = 1j * FREQUENCIES
    assert margins(gain / s)[:2] == (crossover, math.inf)


def discrete_radius(pid, gain, delay):
    """Return the largest closed-loop eigenvalue of a PID on 1/s^2 behind the motor's lag, exactly discretised."""
    a = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0 / AIRFRAME.motor.time_constant]])
    b = np.array([[0.0], [0.0], [1.0 / AIRFRAME.motor.time_constant]])
    A, B, *_ = cont2discrete((a, b, np.eye(3), np.zeros((3, 1))), TICK)
    n = 4 + delay  # position, velocity, acceleration, integral, delayed commands
    M = np.zeros((n, n))
    M[:3, :3] = A
    M[3, 0], M[3, 3] = TICK, 1.0
    # The integral includes the error of the tick itself.
    command = -gain * np.array([pid.p + pid.i * TICK, pid.d, 0.0, pid.i] + [0.0] * delay)
    if delay:
        M[:3, n - 1] = B[:, 0]
        M[4] = command
        for k in range(5, n):
            M[k, k - 1] = 1.0
    else:
        M[:3] += np.outer(B[:, 0], command)
    return np.abs(np.linalg.eigvals(M)).max()


@pytest.mark.parametrize("delay", [0, 1])
@pytest.mark.parametrize("name", ["paper", "tuned"])
def test_gain_margin_is_where_discrete_loop_becomes_unstable(name, delay):
    p = build(load(name), AIRFRAME)
    arm = 4.0 * AIRFRAME.rotor_x[0]
    for loop, pid, effect in (
        ("altitude", p.altitude, 4.0 / AIRFRAME.mass),
        ("pitch", p.pitch_inner, arm / AIRFRAME.inertia_body[1]),
    ):
        m = margins(open_loops(p, AIRFRAME, TICK, delay)[loop])
        # Half a tick approximates the zero-order hold, well below the Nyquist frequency.
        assert discrete_radius(pid, effect * 0.85 * m.gain, delay) < 1.0
        assert discrete_radius(pid, effect * 1.15 * m.gain, delay) > 1.0


@pytest.mark.parametrize("gain", [0.8, 1.0, 1.25])
def test_tuned_keeps_its_margins(gain):
    p = build(load("tuned"), AIRFRAME)
    for loop, response in open_loops(p, AIRFRAME, TICK, delay=1, gain=gain).items():
        m = margins(response)
        assert m.gain > 10.0 ** (6.0 / 20.0), loop
        assert m.reduction < 0.5, loop
        assert math.degrees(m.phase) > (45.0 if gain == 1.0 else 40.0), loop
