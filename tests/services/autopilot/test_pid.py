import pytest

from lapwing.services.autopilot.pid import Pid, integrate, output


def test_output_on_ramp_of_error_is_closed_form():
    gains, dt, integral = Pid(2.0, 3.0, 5.0), 1e-4, 0.0
    for k in range(1, 20_001):
        integral = integrate(gains, integral, 0.7 * k * dt, 0.0, dt)
    assert output(gains, integral, 1.4, 0.7) == pytest.approx(
        2.0 * 1.4 + 3.0 * 0.7 * 2.0**2 / 2.0 + 5.0 * 0.7, rel=1e-4
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_integral_stops_only_in_direction_of_saturation(sign):
    gains = Pid(sign, sign, 0.0)
    pushing, relieving = 2.0, -2.0  # errors; the output that was cut had the sign of sign * pushing
    assert integrate(gains, 1.0, pushing, sign, 0.1) == 1.0
    assert integrate(gains, 1.0, relieving, sign, 0.1) == pytest.approx(0.8)
    assert integrate(gains, 1.0, pushing, 0.0, 0.1) == pytest.approx(1.2)
