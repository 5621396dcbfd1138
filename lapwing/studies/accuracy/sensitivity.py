"""Sensitivity of a closed loop: amplification of small differences by sensors and autopilot.

Sensor resolution, thresholds and mode changes turn any difference into one of a digit or a tick. Two flights with the
same solver and initial states that differ by a small share of the accuracy show it independent of solver errors.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.config.run_config import PerVehicle, RunConfig, ServiceConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.tick_schedule import LATCHED
from lapwing.kernels.row_packing import columns
from lapwing.services.plant.blocks.multirotor import MultirotorPlantState
from lapwing.services.process_table import CLOCK_OWNER

SHARE = 1e-4  # share of the accuracy: difference of the initial states
MIN_DIFFERENCE = 1e-12  # relative difference above round-off


class Signal(NamedTuple):
    """Output of a service, at the time of its first difference between two flights."""

    name: str
    difference: float  # relative to 1 + size
    time: float  # [s]


def start_difference(accuracy: float) -> float:
    """Return the difference of two initial states, relative to 1 + size, for an accuracy."""
    return max(SHARE * accuracy, MIN_DIFFERENCE)


def with_start_shifted(config: RunConfig, difference: float) -> RunConfig:
    """Return a run configuration with each number x of the initial motions increased by difference (1 + |x|)."""
    plant = config.services[CLOCK_OWNER]
    if isinstance(plant.parameters, PerVehicle):
        vehicles, configs = plant.parameters
        plant = plant._replace(
            parameters=PerVehicle(vehicles, tuple(_shift_start(each, difference) for each in configs))
        )
    else:
        plant = _shift_start(plant, difference)
    return config._replace(services={**config.services, CLOCK_OWNER: plant})


def _shift_start(service: ServiceConfig, difference: float) -> ServiceConfig:
    start = service.parameters.start
    if isinstance(start, MultirotorPlantState):
        shifted = start._replace(vehicle=start.vehicle._replace(motion=_shift(start.vehicle.motion, difference)))
    else:
        shifted = _shift(start, difference)
    return service._replace(parameters=service.parameters._replace(start=shifted))


def _shift(tree: Any, difference: float) -> Any:
    if isinstance(tree, tuple):
        items = [_shift(item, difference) for item in tree]
        return type(tree)(*items) if hasattr(tree, "_fields") else tuple(items)
    return tree + difference * (1.0 + abs(tree)) if isinstance(tree, float) else tree


def first_signal(a: BlockDiagram, b: BlockDiagram, limit: float) -> Signal | None:
    """Return the first output of a service other than the plant that differs by more than `limit`.

    Args:
        a: finished run with the full history of all ports.
        b: a similar run.
        limit: limit of the difference, relative to 1 + size.
    """
    first: Signal | None = None
    for service in a.services:
        for port in (port for block in service.blocks for port in block.outputs):
            if service.name == CLOCK_OWNER or port.period == LATCHED:
                continue
            pair = [columns(port.example, diagram.history(port.name, port.period)) for diagram in (a, b)]
            for name, one, other in _pair_columns(port.name, *pair):
                signal = _first_difference(name, one, other, limit, port.period * a.config.interval)
                if signal and (first is None or signal.time < first.time):
                    first = signal
    return first


def _pair_columns(name: str, a: Any, b: Any) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield the name and the columns of each number in two trees."""
    if isinstance(a, tuple):
        names = [f".{field}" for field in a._fields] if hasattr(a, "_fields") else [f"[{i}]" for i in range(len(a))]
        for suffix, one, other in zip(names, a, b, strict=True):
            yield from _pair_columns(name + suffix, one, other)
    else:
        n = min(len(a), len(b))
        yield name, a[:n].reshape(n, -1), b[:n].reshape(n, -1)


def _first_difference(name: str, a: np.ndarray, b: np.ndarray, limit: float, period: float) -> Signal | None:
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore"):
        difference = np.where(same, 0.0, np.abs(a - b) / (1.0 + np.abs(b)))
    difference = np.nan_to_num(difference, nan=np.inf)
    if not (difference > limit).any():
        return None
    row = int((difference > limit).any(axis=1).argmax())
    return Signal(name, float(difference[row].max()), row * period)
