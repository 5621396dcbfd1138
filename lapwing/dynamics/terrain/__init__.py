"""The ground: level, or a relief. Which of the two is known when a kernel is compiled, so that level ground is free.

`relief` makes one from a slope, bumps, steps, a grid of heights, boxes and cylinders (theory.md, section 2.9).
"""

from lapwing.dynamics.terrain.heightfield import Relief, ray
from lapwing.dynamics.terrain.terrain_builder import relief
from lapwing.dynamics.terrain.terrain_queries import LEVEL, Level, over_plane, summit, surface, touch, upright

__all__ = ["LEVEL", "Level", "Relief", "over_plane", "ray", "relief", "summit", "surface", "touch", "upright"]
