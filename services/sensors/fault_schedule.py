"""Compilation of fault schedules from a scene's tables."""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from annotated_types import Ge, Le, Len
from pydantic import ConfigDict, Field, ValidationError

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.validation import Table, fault
from lapwing.services.sensors.delay_line import ALL_CHANNELS, DEPTH, DRIFT, KINDS, Fault

SLOTS = 4  # faults of a sensor; a fixed number, so that all schedules share their machine code
_FOREVER = 2**62  # [tick]


class FaultTable(Table):
    """Scene table of a sensor fault.

    `dropout`: invalid readings. `freeze`: the last value repeated. `bias`: `size` added. `spikes`: with `probability`,
    a normal random number of standard deviation `size` added. `drift`: `size` added per second since `start`. `scale`:
    multiplied by `size`. `delay`: `samples` added to the latency.
    """

    model_config = ConfigDict(strict=False, allow_inf_nan=True)
    kind: Literal["dropout", "freeze", "bias", "spikes", "drift", "scale", "delay"]  # type of the fault
    start: Annotated[float, Ge(0)] = 0.0  # [s] simulation time
    stop: float = math.inf  # [s] simulation time; default: until the end of the run
    channel: str = "all"  # channel of the sensor; default: all
    size: float | Annotated[list[float], Len(3, 3)] = 0.0  # SI unit of the channel; spikes: deviation; drift: per s
    probability: Annotated[float, Ge(0), Le(1)] = 0.1  # of a spike, per sample
    samples: Annotated[int, Field(ge=0, lt=DEPTH)] = 0  # [samples] delay in addition to the latency


def compile_faults(
    tables: Sequence[Mapping[str, Any]], channels: Sequence[str], tick: float
) -> tuple[Fault, ...] | None:
    """Return the faults of a sensor. Return None if there are none.

    Args:
        tables: fault tables. See `FaultTable`.
        channels: names of the sensor's channels.
        tick: length of a tick [s].

    Raises:
        ConfigError: a value is invalid; the key is relative, such as `faults.0.kind`.
    """
    if not isinstance(tables, Sequence) or len(tables) > SLOTS:
        raise ConfigError("faults", f"got {tables!r}", f"a list of at most {SLOTS} tables")
    faults = [_fault(i, table, channels, tick) for i, table in enumerate(tables)]
    return tuple(faults + [Fault()] * (SLOTS - len(faults))) if faults else None


def _fault(number: int, table: Mapping[str, Any], channels: Sequence[str], tick: float) -> Fault:
    try:
        t = FaultTable.model_validate(table)
    except ValidationError as error:
        raise fault(error, FaultTable).with_prefix(f"faults.{number}") from None
    if t.channel not in ("all", *channels):
        raise ConfigError.unknown(f"faults.{number}.channel", "channel", t.channel, ("all", *channels))
    if not t.stop > t.start:
        raise ConfigError(f"faults.{number}.stop", f"got {t.stop:g} s", f"later than start = {t.start:g} s")
    kind = KINDS.index(t.kind)
    size = t.size if isinstance(t.size, list) else [t.size] * 3
    x, y, z = (tick * component if kind == DRIFT else component for component in size)
    return Fault(
        kind,
        ALL_CHANNELS if t.channel == "all" else channels.index(t.channel),
        math.ceil(t.start / tick - 1e-9),
        _FOREVER if math.isinf(t.stop) else math.ceil(t.stop / tick - 1e-9),
        (x, y, z),
        t.probability,
        t.samples,
    )
