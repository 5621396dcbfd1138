"""Work-precision study: every integrator at several steps or tolerances, on systems with a known solution.

`lapwing accuracy TARGET`; a target is a problem of `systems/`, or a scene.
"""

from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.targets import find
from lapwing.studies.accuracy.work_precision import Point, cheapest, measure

__all__ = ["Point", "Problem", "cheapest", "find", "measure"]
