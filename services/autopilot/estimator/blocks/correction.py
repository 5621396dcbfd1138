"""Fusion of barometer, magnetometer, distance and optical flow readings."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import DispatchTable, always_inline
from lapwing.kernels.codegen import dispatch
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.estimator import Estimator, State
from lapwing.services.autopilot.estimator.blocks.navigation_state import NavigationState
from lapwing.services.common.ports import BarometerReading, DistanceReading, MagnetometerReading, OpticalFlowReading


class Correction(NamedTuple):
    """Parameters of the block."""

    filter: Estimator


@always_inline
def _barometer(p: Estimator, x: State, r: BarometerReading) -> State:
    return estimator.update_barometer(p, x, r.pressure, r.variance, r.valid)


@always_inline
def _magnetometer(p: Estimator, x: State, r: MagnetometerReading) -> State:
    return estimator.update_magnetometer(p, x, r.field_body, r.variance, r.valid)


@always_inline
def _distance(p: Estimator, x: State, r: DistanceReading) -> State:
    return estimator.update_sonar(p, x, r.range, r.variance, r.valid)


@always_inline
def _flow(p: Estimator, x: State, r: OpticalFlowReading) -> State:
    return estimator.update_flow(p, x, r.flow, r.rate, r.distance, r.variance, r.valid)


UPDATES = DispatchTable()
"""Filter update by reading class."""
UPDATES[BarometerReading] = _barometer
UPDATES[MagnetometerReading] = _magnetometer
UPDATES[DistanceReading] = _distance
UPDATES[OpticalFlowReading] = _flow
update = dispatch(UPDATES, 2)


@always_inline
def step(
    p: Correction, s: NavigationState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[NavigationState, tuple[()], int]:
    """Correct the filter by the reading of the tick."""
    x = s.filter
    if s.started:
        x = update(p.filter, x, inputs[0].value)
    return NavigationState(s.started, x), (), CONTINUE
