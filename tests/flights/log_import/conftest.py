"""Flight for the writers of all formats, and its logs with changed messages."""

import flight_writers
import numpy as np
import pytest
from flight_recordings import BATTERY
from flight_writers import DATAFLASH, GRAVITY, INTERVAL, SAMPLES, dataflash_rows, telemetry, write_bin, write_tlog
from scipy.spatial.transform import Rotation

from lapwing.flights.log_import.open_flight import open_flight
from lapwing.flights.log_import.recording import Recording


@pytest.fixture(scope="module")
def flight() -> Recording:
    """Return a smooth rotation about all axes with consistent rates, specific force and velocity."""
    t = INTERVAL * np.arange(SAMPLES)
    angles = np.column_stack([0.8 * t, 0.3 * np.sin(2.0 * t), 0.2 * np.cos(1.5 * t)])  # yaw, pitch, roll
    turn = Rotation.from_euler("ZYX", angles)
    h = 1e-5
    ahead = Rotation.from_euler(
        "ZYX", np.column_stack([0.8 * (t + h), 0.3 * np.sin(2 * (t + h)), 0.2 * np.cos(1.5 * (t + h))])
    )
    omega = (turn.inv() * ahead).as_rotvec() / h
    position = np.column_stack([1.0 + 0.5 * t, 2.0 * np.sin(t), 3.0 + 0.2 * t**2])
    velocity = np.column_stack([0.5 + 0.0 * t, 2.0 * np.cos(t), 0.4 * t])
    acceleration = np.column_stack([0.0 * t, -2.0 * np.sin(t), 0.4 + 0.0 * t])
    force = turn.inv().apply(acceleration + np.array([0.0, 0.0, GRAVITY]))
    duty = 0.5 + 0.1 * np.column_stack([np.sin(t + k) for k in range(4)])
    return Recording(
        "flight", INTERVAL, position, turn.as_quat()[:, [3, 0, 1, 2]], velocity, omega, force, duty * BATTERY,
        np.full(SAMPLES, BATTERY), np.ones(SAMPLES, bool),
    )  # fmt: skip


@pytest.fixture
def dataflash(tmp_path, flight, monkeypatch):
    """Return the import of a dataflash log whose rows, and types of messages, a test changes."""

    def imported(change, types=(), read=open_flight):
        rows = [new for row in dataflash_rows(flight) for new in change(*row)]
        with monkeypatch.context() as patch:
            for name, entry in dict(types).items():
                patch.setitem(DATAFLASH, name, entry)
            patch.setattr(flight_writers, "dataflash_rows", lambda flight: iter(rows))
            write_bin(tmp_path / "f.bin", flight)
        return read(tmp_path / "f.bin")

    return imported


@pytest.fixture
def tlog(tmp_path, flight, monkeypatch):
    """Return the import of a telemetry log whose messages a test changes, with errors of the host's clock [s]."""

    def imported(change=lambda k, message: [message], host=lambda k: 0.0, read=open_flight):
        with monkeypatch.context() as patch:
            patch.setattr(flight_writers, "telemetry", lambda v, k: [n for m in telemetry(v, k) for n in change(k, m)])
            patch.setattr(flight_writers, "host_clock", host)
            write_tlog(tmp_path / "f.tlog", flight)
        return read(tmp_path / "f.tlog")

    return imported
