"""Cost of a scanning lidar of 16 x 360 rays at 10 Hz: share of one core in simulated real time, including messages."""

import time

import numpy as np

from benchmarks._targets import Row
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.terrain import LEVEL, relief
from lapwing.messages.cdr_arrays import Record
from lapwing.services.sensors import lidar
from lapwing.services.sensors.block import Instrument
from lapwing.services.sensors.scan import ScanPose

SCANS = 20
REPEATS = 5
TARGET = 0.20  # share of one core


def terrains():
    """Return level ground, obstacles on it, and a grid of heights with them."""
    boxes = [(6.0 * k - 15.0, 8.0, 4.0, 3.0, 0.3 * k, 6.0) for k in range(6)]
    cylinders = [(5.0 * k, -6.0, 0.5, 5.0) for k in range(3)]
    x = np.linspace(-50.0, 50.0, 101)
    grid = 0.5 * np.sin(0.2 * x)[:, None] * np.cos(0.15 * x)
    obstacles = {"boxes": boxes, "cylinders": cylinders}
    return {
        "level ground": LEVEL,
        "6 boxes, 3 cylinders": relief(**obstacles),
        "grid, 6 boxes, 3 cylinders": relief(**obstacles, grid=grid, corner=(-50.0, -50.0)),
    }


def share(terrain):
    """Return the least share of a core over the repeats."""
    instrument = Instrument(lidar.VLP16, (1, 2), 9.81, STANDARD._replace(terrain=terrain))
    (encoder,) = lidar.wires("drone1", Port("lidar", lidar.READING, 25), instrument)
    record, ticks = Record.of(encoder.sample()), np.arange(SCANS)
    position = np.column_stack([0.1 * ticks, 0.0 * ticks, 2.0 + 0.0 * ticks])
    pose = ScanPose(position, np.tile([1.0, 0.0, 0.0, 0.0], (SCANS, 1)), ticks)
    record.encode(SCANS, encoder.fields(pose, ticks * 100_000_000))
    spent = []
    for _ in range(REPEATS):
        start = time.process_time()
        record.encode(SCANS, encoder.fields(pose, ticks * 100_000_000))
        spent.append(time.process_time() - start)
    return min(spent) / (SCANS / lidar.VLP16.rate)


def main():
    """Print and return the shares."""
    rows = []
    for name, terrain in terrains().items():
        value = share(terrain)
        print(f"{name}: {100.0 * value:.1f} % of a core")
        rows.append(Row(f"lidar 16 x 360 at 10 Hz, {name}", value, "core", TARGET))
    return rows


if __name__ == "__main__":
    main()
