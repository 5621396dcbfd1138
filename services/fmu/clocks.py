"""Input clocks of an FMU for scheduled execution; each activates a model partition."""

import math
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as Xml

from lapwing.dynamics.config_error import ConfigError

DESCRIPTION = "modelDescription.xml"
PERIODIC, COUNTDOWN, TRIGGERED = ("constant", "fixed"), "countdown", "triggered"


class Clock(NamedTuple):
    """Input clock of an FMU."""

    name: str
    reference: int
    variability: str  # interval variability, as FMI names it
    interval: float  # [s] interval between two ticks; 0: not in the description
    shift: float  # [s] time of the first tick
    priority: int  # priority of the partition; of simultaneous ones the lowest number is first


def input_clocks(description: bytes) -> list[Clock]:
    """Return the input clocks of a model description in FMI 3.0; FMPy does not read their intervals and priorities."""
    clocks = Xml.fromstring(description).iterfind("ModelVariables/Clock[@causality='input']")
    return [
        Clock(
            each.get("name", ""),
            int(each.get("valueReference", "")),
            each.get("intervalVariability", ""),
            _seconds(each, "interval"),
            _seconds(each, "shift"),
            int(each.get("priority", "0")),
        )
        for each in clocks
    ]


def _seconds(clock: Xml.Element, name: str) -> float:
    """Return "interval" or "shift" of a clock [s], given as decimal numbers or as counters with a resolution [1/s]."""
    decimal, counter = clock.get(f"{name}Decimal"), clock.get(f"{name}Counter")
    if decimal is None and counter is not None:
        return int(counter) / int(clock.get("resolution", "1"))
    return float(decimal or 0.0)


def check_clock(key: str, path: Path, clock: Clock, tick: float) -> None:
    """Raise ConfigError if a run with ticks of this length [s] cannot activate a clock.

    Args:
        key: key of the FMU, for messages.
        path: path of the FMU, for messages.
        clock: input clock of the FMU.
        tick: length of a tick [s].
    """
    if clock.variability in (COUNTDOWN, TRIGGERED):
        return
    where = f"{path}: clock {clock.name}"
    if clock.variability not in PERIODIC:
        supported = ", ".join((*PERIODIC, COUNTDOWN, TRIGGERED))
        raise ConfigError(
            key, f"{where} has the interval variability {clock.variability or 'none'}", f"one of {supported}"
        )
    if not clock.interval > 0.0:
        raise ConfigError(key, f"{where} has no interval in {DESCRIPTION}", "intervalDecimal above 0")
    for name, value in (("interval", clock.interval), ("shift", clock.shift)):
        if not (math.isfinite(value) and value >= 0.0 and abs(value / tick - round(value / tick)) <= 1e-6):
            raise ConfigError(key, f"{where} has the {name} {value:g} s", f"a multiple of the tick, {tick:g} s")
