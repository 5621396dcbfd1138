"""Time to write the report of the delivery mission after the flight, and its size.

    python -m benchmarks.report [REPEATS]

Each repeat is a process of its own, as `lapwing run` is one: imports that only the report needs count, reading the log
and the errors that the terminal shows do not.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from benchmarks._targets import Row

SCENE = "lapwing/scenes/delivery_mission.toml"
WRITE = """
import json, sys, time
from pathlib import Path
from lapwing.studies.flight_data import Flight
flight = Flight.read(sys.argv[1])
flight.rmse, flight.landed
wall, busy = time.perf_counter(), time.process_time()
from lapwing.studies.report import write
path = write(flight, Path(sys.argv[2]))
wall, busy = time.perf_counter() - wall, time.process_time() - busy
print(json.dumps({"wall": wall, "busy": busy, "size": path.stat().st_size}))
"""


def main(repeats=5):
    with tempfile.TemporaryDirectory() as folder:
        log = str(Path(folder, "log.mcap"))
        words = ["run", SCENE, "--mode", "single-process", "--log", log]
        subprocess.run([sys.executable, "-m", "lapwing", *words], check=True, stdout=subprocess.DEVNULL)
        for ending in ("html", "pdf", "png"):
            command = [sys.executable, "-c", WRITE, log, str(Path(folder, f"report.{ending}"))]
            runs = [json.loads(subprocess.check_output(command)) for _ in range(repeats)]
            wall, busy = (median(run[key] for run in runs) for key in ("wall", "busy"))
            size = runs[0]["size"] / 1e6
            print(f"report as {ending:4}: {wall:.2f} s, {busy:.2f} s of processor time, {size:.1f} MB")
            if ending == "html":
                result = [Row("report of the mission, a page", wall, "s", 0.3)]
    return result


if __name__ == "__main__":
    main(*[int(a) for a in sys.argv[1:]])
