"""Processor time to compile, from an empty cache until a scene has flown, imports included.

python -m benchmarks.compile_time
"""

import subprocess
import sys

from benchmarks._bars import Row, empty_cache, show

FLY = """
import sys, time
import lapwing
lapwing.{how}
print(time.process_time())
"""
HOVER, MISSION = "fly('hover')", "fly('delivery_mission')"
MORE = "fly('delivery_mission', {'effects.body_drag.area': [0.06, 0.06, 0.06]})"
LOOP = "campaign('delivery_mission', runs=1)"
EULER = "fly('delivery_mission', {'vehicle.model': 'multibody', 'multibody.coordinates': 'euler', 'run.duration': 0.1})"


def taken(environment, how):
    """Processor time [s] of a process that does so."""
    output = subprocess.check_output([sys.executable, "-c", FLY.format(how=how)], env=environment, text=True)
    return float(output.splitlines()[-1])


def rows():
    with empty_cache() as environment:
        yield Row("hover, cold, processor time", taken(environment, HOVER), "s", 12.0)
    with empty_cache() as environment:
        yield Row("mission, cold, processor time", taken(environment, MISSION), "s", 30.0)
        yield Row("one more effect, processor time", taken(environment, MORE), "s", 7.0)
    with empty_cache() as environment:
        yield Row("the mission's closed loop, cold, processor time", taken(environment, LOOP), "s", 12.0)
    with empty_cache() as environment:
        yield Row("five bodies in Euler angles, cold, processor time", taken(environment, EULER), "s", 40.0)


def main():
    found = list(rows())
    show(found)
    return found


if __name__ == "__main__":
    main()
