"""What partners may ask for: a file for each protocol of MAVLink, each saying which messages it answers."""

import importlib
import pkgutil

from services.mavlink.protocols.handler import HANDLERS

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")

__all__ = ["HANDLERS"]
