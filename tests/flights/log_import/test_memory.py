"""Memory that the import of a log needs over its size."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from flight_writers import WRITERS

MULTIPLE = 8.0  # bytes for each byte of the file, as docs/guides/match_your_vehicle.md states
PEAKS = """
import sys
from pathlib import Path
from lapwing.flights.log_import.open_flight import open_flight

for path in sys.argv[1:]:
    open_flight(Path(path))
    print(next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1])
"""


def repeated(flight, times):
    names = ("position", "attitude", "velocity", "omega", "specific_force", "motor_voltage")
    columns = {name: np.tile(getattr(flight, name), (times, 1)) for name in names}
    return replace(
        flight, battery_voltage=np.tile(flight.battery_voltage, times), valid=np.tile(flight.valid, times), **columns
    )


@pytest.mark.long
@pytest.mark.parametrize("name", ["f.bin", "f.tlog"])
def test_memory_is_bounded_by_a_multiple_of_the_file(tmp_path, flight, name):
    files = [tmp_path / f"{k}{name}" for k in (1, 80)]
    for path, times in zip(files, (1, 80), strict=True):
        WRITERS[name](path, repeated(flight, times))
    done = subprocess.run([sys.executable, "-c", PEAKS, *map(str, files)], capture_output=True, text=True, check=True)
    small, large = (1024 * int(line) for line in done.stdout.split())
    assert large - small < MULTIPLE * (files[1].stat().st_size - files[0].stat().st_size)
