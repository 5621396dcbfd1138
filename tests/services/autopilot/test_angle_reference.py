import numpy as np
import pytest
from scipy.signal import TransferFunction, step

from lapwing.services.autopilot.angle_reference import AT_REST, Smoothing, advance


@pytest.mark.parametrize("lag", [0.0, 0.02])
def test_step_response_is_that_of_transfer_function(lag):
    w, damping, dt = 20.0, 0.7, 1e-4
    t = np.arange(1, 5001) * dt
    denominator = np.polymul([1.0, 2.0 * damping * w, w * w], [lag, 1.0] if lag else [1.0])
    _, expected = step(TransferFunction([w * w], denominator), T=np.concatenate(([0.0], t)))
    state, angles = AT_REST, []
    for _ in t:
        state = advance(Smoothing(w, damping, lag), state, 1.0, dt)
        angles.append(state.angle)
    assert np.array(angles) == pytest.approx(expected[1:], abs=2e-3)


def test_command_leads_reference_by_lag():
    # A double integrator behind the lag, driven by the demanded acceleration, ends each tick on the reference.
    p, dt, sub = Smoothing(22.0, 0.6, 0.02), 0.004, 400
    state, angle, rate, delivered = AT_REST, 0.0, 0.0, 0.0
    for k in range(60):
        state = advance(p, state, 0.3 if k < 30 else -0.1, dt)
        for _ in range(sub):
            h = dt / sub
            before = delivered
            delivered += (1.0 - np.exp(-h / p.lag)) * (state.command_acceleration - delivered)
            angle, rate = angle + h * rate, rate + 0.5 * h * (before + delivered)
        assert state.rate == pytest.approx(rate, abs=1e-5)
        assert state.angle == pytest.approx(angle, abs=1e-4)
