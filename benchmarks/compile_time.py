"""Processor time from an empty cache to the end of a scene's flight, including imports.

python -m benchmarks.compile_time
"""

import os
import subprocess
import sys
import tempfile

from benchmarks._command import command_line
from benchmarks._targets import Row, show

DRAG = {"effects.body_drag.area": [0.06, 0.06, 0.06], "effects.random_wind_force.allow_body_drag": True}
EULER = {"vehicle.model": "multibody", "multibody.coordinates": "euler", "run.duration": 0.1}
# Flights: function of `lapwing`, its arguments, and target [s]; those of one group share a cache.
GROUPS = (
    (("hover, cold", "fly('hover')", 12.0),),
    (
        ("mission, cold", "fly('delivery_mission')", 30.0),
        ("one more effect, cold", f"fly('delivery_mission', {DRAG})", 7.0),
        ("the mission's closed loop, once the mission has flown", "campaign('delivery_mission', [1])", 12.0),
    ),
    (("the mission's closed loop, cold", "campaign('delivery_mission', [1])", 12.0),),
    (("five bodies in Euler angles, cold", f"fly('delivery_mission', {EULER})", 40.0),),
)


def processor_time(environment, call):
    """Return the processor time [s] of a process with this call."""
    code = f"import time, lapwing; lapwing.{call}; print(time.process_time())"
    return float(subprocess.check_output([sys.executable, "-c", code], env=environment, text=True).splitlines()[-1])


def rows():
    for group in GROUPS:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as cache:
            environment = {**os.environ, "LAPWING_CACHE": cache}
            for name, call, bar in group:
                yield Row(f"{name}, processor time", processor_time(environment, call), "s", bar)


def main():
    return show(rows())


if __name__ == "__main__":
    command_line(main)
