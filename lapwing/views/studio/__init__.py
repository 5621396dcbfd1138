"""Local web page to select a scene, edit it in a form, run it, watch it and compare flights.

starlette and uvicorn are optional dependencies, the extra `studio`, imported by `lapwing studio` only.
"""

import importlib.util

MISSING = "lapwing studio: starlette or uvicorn is not installed; pip install lapwing[studio]"


def require() -> None:
    """Raise ValueError if the packages of the extra `studio` are missing."""
    if not all(map(importlib.util.find_spec, ("starlette", "uvicorn"))):
        raise ValueError(MISSING)
