"""Whose autopilot the vehicle passes for: a file each, found by its name."""

import importlib
from types import ModuleType


def get(name: str) -> ModuleType:
    """The flavour's module.

    It has `AUTOPILOT`; `mode_number(mode)`, the custom mode that shows a mode of ours; `mode_kind(number)`, the kind of
    command that enters a custom mode, None where there is none; `custom_mode(main, sub)`, the number that
    DO_SET_MODE spells in two parameters; `param_float(value, integer)` and `param_value(float, integer)`, how whole
    numbers travel in a float; `HOME_FIRST`, whether item 0 of a mission is home; `TAKEOFF_ABOVE_SEA`, whether a
    take-off's altitude counts from there; `RATES`, rates of messages [Hz] that differ from the telemetry's table.
    """
    return importlib.import_module(f"{__name__}.{name}")
