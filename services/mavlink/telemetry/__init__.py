"""What the vehicle tells without being asked: one table of messages, gathered from the files of this folder."""

import importlib
import pkgutil

from services.mavlink.telemetry.stream import STREAMS, Stream

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")

__all__ = ["STREAMS", "Stream"]
