"""3D view of flights: shaded bodies, ground, trails and arrows in a viser scene, recorded in a page or live.

viser is an optional dependency, the extra `view3d`, and is imported on use.
"""

import importlib.util

MISSING = "the 3D view needs viser; pip install lapwing[view3d]"


def available() -> bool:
    """Return True if the packages of the extra `view3d` are installed."""
    return importlib.util.find_spec("viser") is not None


def require() -> None:
    """Raise ValueError if the packages of the extra `view3d` are missing."""
    if not available():
        raise ValueError(MISSING)
