"""Local web page to pick a scene, change it in a form, fly it, watch it and compare flights.

starlette and uvicorn are imported only by `lapwing studio`; they come with the extra `studio`.
"""

import importlib.util

MISSING = "lapwing studio: starlette or uvicorn is not installed; pip install lapwing[studio]"


def require() -> None:
    """Raise ValueError if the packages of the extra `studio` are missing."""
    if not all(map(importlib.util.find_spec, ("starlette", "uvicorn"))):
        raise ValueError(MISSING)
