"""Loops about hover as systems of python-control, and their step responses."""

from typing import Any, NamedTuple

import control
import numpy as np

from lapwing.services.autopilot.control import Parameters
from lapwing.services.autopilot.controller_parameters import Airframe
from lapwing.services.autopilot.margins import loops

PADE = 3  # order of the approximation of the delay; error of 3e-5 up to 200 rad/s
CANCEL = 1e-6  # relative distance of poles and zeros that cancel
AXES = {"z": "altitude", "yaw": "yaw", "x": "x", "y": "y"}  # loop by axis of the setpoint


class StepResponse(NamedTuple):
    """Response of an axis to a unit step of its setpoint, without feed-forward."""

    time: np.ndarray  # [s]
    value: np.ndarray
    rise: float  # [s] from 10 to 90 %
    overshoot: float  # relative


def systems(p: Parameters, airframe: Airframe, tick: float, delay: int) -> dict[str, Any]:
    """Return open loops as transfer functions; see `lapwing.services.autopilot.margins.open_loops` for arguments."""
    s = control.tf("s")
    delay_transfer = control.tf(*control.pade((delay + 0.5) * tick, PADE))
    return {
        name: control.minreal(loop, CANCEL, verbose=False)
        for name, loop in loops(p, airframe, s, delay_transfer).items()
    }


def close_loop(loop: Any) -> Any:
    """Return the loop closed by unit feedback."""
    return control.minreal(loop / (1.0 + loop), CANCEL, verbose=False)


def step(loop: Any, seconds: float = 5.0) -> StepResponse:
    """Return the step response of a closed loop from its open loop, over a time [s]."""
    time, value = control.step_response(close_loop(loop), np.linspace(0.0, seconds, 1001))
    result = control.step_info(value, time, yfinal=1.0)
    return StepResponse(time, value, result["RiseTime"], result["Overshoot"] / 100.0)
