"""The autopilot's tunable parameters as endpoints see them: numbered, typed, and always acknowledged."""

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

from lapwing.services.mavlink.command_queue import CommandQueue
from lapwing.services.mavlink.dialect import mavlink
from lapwing.services.mavlink.endpoint import Endpoint
from lapwing.services.mavlink.firmware import Flavour
from lapwing.services.mavlink.vehicle_description import VehicleDescription

BY_NAME = -1  # the index of a request that gives a name
MAX_PER_STEP = 20  # values of a list sent to one endpoint at each step of the telemetry


class ParameterStore:
    """The autopilot's parameters with the values that it has last acknowledged, and the facts of the vehicle."""

    def __init__(
        self,
        description: VehicleDescription,
        flavour: Flavour,
        commands: CommandQueue,
        broadcast: Callable[[Any], None],
        counts: Counter[str],
    ):
        """The values that the autopilot starts with.

        Args:
            description: of the vehicle.
            flavour: says how whole numbers travel, and which facts its ground stations ask for.
            commands: to the autopilot.
            broadcast: sends a message to every endpoint.
            counts: what was refused, by reason.
        """
        self._table = {p.name: p for p in description.parameters}
        self._facts = {f.name: f for f in flavour.facts(description) if f.name not in self._table}
        self.names = sorted([*self._table, *self._facts])  # in the order of their indices
        self._number = {name: k for k, name in enumerate(self.names)}
        self._values = {name: p.default for name, p in self._table.items()}
        self._flavour, self._commands, self._broadcast, self._counts = flavour, commands, broadcast, counts
        self._lists: dict[Endpoint, int] = {}  # lists on their way: the next index of each

    def value(self, name: str) -> float:
        """A parameter's value, NaN where there is no such parameter."""
        fact = self._facts.get(name)
        return fact.value(self._values) if fact else self._values.get(name, math.nan)

    def start_list(self, endpoint: Endpoint) -> None:
        """Send all, a few at a time."""
        self._lists[endpoint] = 0

    def step(self) -> None:
        """Go on with the lists."""
        for endpoint, begin in list(self._lists.items()):
            for name in self.names[begin : begin + MAX_PER_STEP]:
                self._send(endpoint, name)
            self._lists[endpoint] = begin + MAX_PER_STEP
            if begin + MAX_PER_STEP >= len(self.names):
                del self._lists[endpoint]

    def forget(self, endpoint: Endpoint) -> None:
        """An endpoint is gone."""
        self._lists.pop(endpoint, None)

    def read(self, endpoint: Endpoint, name: str, index: int) -> None:
        """Send one, by its name or its index."""
        if index != BY_NAME:
            name = self.names[index] if 0 <= index < len(self.names) else ""
        if name in self._number:
            self._send(endpoint, name)
        else:
            self._refuse(endpoint, name, index, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)

    def set(self, endpoint: Endpoint, name: str, value: float, trusted: bool) -> None:
        """Ask the autopilot for a new value; every endpoint is told what it is then."""
        if name in self._facts:
            self._refuse(endpoint, name, BY_NAME, mavlink.MAV_PARAM_ERROR_READ_ONLY)
            self._send(endpoint, name)
            return
        parameter = self._table.get(name)
        if parameter is None:
            self._refuse(endpoint, name, BY_NAME, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)
            return
        wanted = self._flavour.param_value(value, parameter.whole)

        def acknowledged(acknowledgement: Any) -> None:
            if acknowledgement.result == mavlink.MAV_RESULT_ACCEPTED:
                self._change(name, acknowledgement.value)
            else:
                self._refuse(endpoint, name, BY_NAME, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)
                self._send(endpoint, name)

        if not trusted:
            self._refuse(endpoint, name, BY_NAME, mavlink.MAV_PARAM_ERROR_PERMISSION_DENIED)
            self._send(endpoint, name)
        elif not math.isfinite(wanted):
            self._refuse(endpoint, name, BY_NAME, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)
            self._send(endpoint, name)
        else:
            self._commands.put("parameter", endpoint.name, acknowledged, (wanted,), name)

    def _change(self, name: str, value: float) -> None:
        """Tell every endpoint the new value, and the facts that follow from it."""
        before = {fact: self.value(fact) for fact in self._facts}
        self._values[name] = value
        for changed in (name, *[fact for fact in self._facts if self.value(fact) != before[fact]]):
            self._broadcast(self._message(changed))

    def _send(self, endpoint: Endpoint, name: str) -> None:
        endpoint.send(self._message(name))

    def _message(self, name: str) -> Any:
        integer = (self._table.get(name) or self._facts[name]).whole
        kind = mavlink.MAV_PARAM_TYPE_INT32 if integer else mavlink.MAV_PARAM_TYPE_REAL32
        value = self._flavour.param_float(self.value(name), integer)
        return mavlink.MAVLink_param_value_message(name.encode(), value, kind, len(self.names), self._number[name])

    def _refuse(self, endpoint: Endpoint, name: str, index: int, error: int) -> None:
        self._counts["parameter refused"] += 1
        endpoint.send(
            mavlink.MAVLink_param_error_message(endpoint.system, endpoint.component, name.encode(), index, error)
        )
