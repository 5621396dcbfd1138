"""Cost of a scanning lidar of 16 x 360 rays at 10 Hz: share of one core in simulated real time, including messages."""

import time

import numpy as np

from benchmarks._command import command_line
from benchmarks._targets import Row
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.terrain import LEVEL, relief
from lapwing.dynamics.vehicles.visible_body import VisibleBody
from lapwing.messages.cdr_arrays import Record
from lapwing.services.sensors import lidar
from lapwing.services.sensors.block import Instrument
from lapwing.services.sensors.scan import ScanPose, VehiclePose

SCANS = 20
REPEATS = 5
OTHERS = 9  # vehicles around the lidar
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


def share(terrain, vehicles=0):
    """Return the least share of a core over the repeats, with this number of other vehicles 5 m away."""
    bodies = (VisibleBody(0.0, 0.0, 0.5, -0.2, 0.1),) * vehicles
    instrument = Instrument(lidar.VLP16, (1, 2), 9.81, STANDARD._replace(terrain=terrain), bodies)
    (encoder,) = lidar.topic_encoders("drone1", Port("lidar", lidar.READING, 25), instrument)
    record, ticks = Record.of(encoder.sample()), np.arange(SCANS)
    position = np.column_stack([0.1 * ticks, 0.0 * ticks, 2.0 + 0.0 * ticks])
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (SCANS, 1))
    angles = [2.0 * np.pi * k / max(vehicles, 1) for k in range(vehicles)]
    others = tuple(VehiclePose(position + 5.0 * np.array([np.cos(a), np.sin(a), 0.0]), upright) for a in angles)
    pose = ScanPose(position, upright, ticks, others)
    record.encode(SCANS, encoder.fields(pose, ticks * 100_000_000))
    spent = []
    for _ in range(REPEATS):
        start = time.process_time()
        record.encode(SCANS, encoder.fields(pose, ticks * 100_000_000))
        spent.append(time.process_time() - start)
    return min(spent) / (SCANS / lidar.VLP16.rate)


def main():
    """Print and return the shares."""
    cases = [(name, terrain, 0) for name, terrain in terrains().items()]
    cases.append((f"level ground, {OTHERS} vehicles", LEVEL, OTHERS))
    rows = []
    for name, terrain, vehicles in cases:
        value = share(terrain, vehicles)
        print(f"{name}: {100.0 * value:.1f} % of a core")
        rows.append(Row(f"lidar 16 x 360 at 10 Hz, {name}", value, "core", TARGET))
    return rows


if __name__ == "__main__":
    command_line(main)
