"""The shapes of vehicles in space: one file each, found by scanning this folder.

A file names the models of vehicles that it draws in `MODELS`, and has `draw(flight)`, which returns a
`lapwing.studies.report.motion_3d.Motion`, or None where the log does not say enough.
"""

from types import ModuleType

from lapwing.dynamics import discovery


def modules() -> list[ModuleType]:
    """Every shape's module."""
    return list(discovery.modules(__name__).values())
