"""What accuracy costs: every integrator over its steps or tolerances, on systems whose answer is known.

`lapwing accuracy TARGET`; a target is a problem of `systems/`, or a scene's file.
"""

from studies.accuracy.measure import Point, cheapest, measure
from studies.accuracy.problem import Problem
from studies.accuracy.targets import find

__all__ = ["Point", "Problem", "cheapest", "find", "measure"]
