"""Processor time from an empty cache to the end of a scene's flight, including imports; ratios and memory for hover.

python -m benchmarks.compile_time
"""

import os
import subprocess
import sys
import tempfile

from benchmarks._command import command_line
from benchmarks._targets import Row, show

DRAG = {"effects.body_drag.area": [0.06, 0.06, 0.06], "effects.random_wind_force.allow_body_drag": True}
FOUR = {  # more effects than the scene has
    "effects.air_density": {},
    "effects.body_drag.area": [0.06, 0.06, 0.06],
    "effects.gyroscopic_torque": {},
    "effects.wind_constant.velocity": [1.0, 0.0, 0.0],
}
OWN = {"effects.my_drag.module": "my_drag"}
EULER = {"vehicle.model": "multibody", "multibody.coordinates": "euler", "run.duration": 0.1}
# Flights: function of `lapwing`, its arguments, and target [s]; those of one group share a cache.
GROUPS = (
    (
        ("mission, cold", "fly('delivery_mission')", 30.0),
        ("one more effect, cold", f"fly('delivery_mission', {DRAG})", 7.0),
        ("the mission's closed loop, once the mission has flown", "campaign('delivery_mission', [1])", 12.0),
    ),
    (("the mission's closed loop, cold", "campaign('delivery_mission', [1])", 12.0),),
    (("five bodies in Euler angles, cold", f"fly('delivery_mission', {EULER})", 40.0),),
)


def cost(environment, statement):
    """Return (processor time [s], peak memory [MB]) of a process with this statement."""
    code = f"import resource, time; {statement}; print(time.process_time(), resource.getrusage(0).ru_maxrss / 1024)"
    printed = subprocess.check_output([sys.executable, "-c", code], env=environment, text=True)
    return tuple(map(float, printed.splitlines()[-1].split()))


def hover(environment):
    """Yield the rows of hover, which other scenes do not need."""
    imports, _ = cost(environment, "import numba, numpy, mcap")
    cold, memory = cost(environment, "import lapwing; lapwing.fly('hover')")
    four, warm = (cost(environment, f"import lapwing; lapwing.fly('hover', {FOUR})")[0] for _ in range(2))
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, "-m", "lapwing", "new", "effect", "my_drag"],
            cwd=folder,
            check=True,
            stdout=subprocess.DEVNULL,
        )
        own = {**environment, "PYTHONPATH": os.pathsep.join([os.getcwd(), folder])}
        first, again = (cost(own, f"import lapwing; lapwing.fly('hover', {OWN})")[0] for _ in range(2))
    yield Row("hover, cold, processor time", cold, "s", 12.0)
    yield Row("hover, cold / importing numba, numpy and mcap", cold / imports, "", 30.0)
    yield Row("hover, four more effects / the same again", four / warm, "", 2.0)
    yield Row("hover, own effect / the same again", first / again, "", 2.0)
    yield Row("hover, cold, peak memory", memory, "MB", 300.0)


def rows():
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as cache:
        yield from hover({**os.environ, "LAPWING_CACHE": cache})
    for group in GROUPS:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as cache:
            environment = {**os.environ, "LAPWING_CACHE": cache}
            for name, call, bar in group:
                yield Row(f"{name}, processor time", cost(environment, f"import lapwing; lapwing.{call}")[0], "s", bar)


def main():
    return show(rows())


if __name__ == "__main__":
    command_line(main)
