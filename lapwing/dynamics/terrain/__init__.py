"""Terrain: level ground or a relief. The kind is known when a kernel is compiled, so level ground has no cost.

`relief` creates one from a slope, bumps, steps, a grid of heights, boxes and cylinders (theory, section 2.9).
"""

from lapwing.dynamics.terrain.heightfield import Relief, ray
from lapwing.dynamics.terrain.terrain_builder import relief
from lapwing.dynamics.terrain.terrain_queries import LEVEL, Level, over_plane, summit, surface, touch, upright

__all__ = ["LEVEL", "Level", "Relief", "over_plane", "ray", "relief", "summit", "surface", "touch", "upright"]
