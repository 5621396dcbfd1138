"""The autopilot's tunable parameters as clients see them: numbered, typed, and always answered."""

import math
from collections import Counter
from collections.abc import Sequence
from types import ModuleType
from typing import Any

from services.mavlink.client import Client
from services.mavlink.dialect import mavlink
from services.mavlink.requests import Requests
from services.parameters import Parameter

BY_NAME = -1  # the index of a request that gives a name
UNKNOWN = 0xFFFF  # the index of a parameter outside the list
PER_STEP = 20  # values of a list sent to one client at each step of the telemetry


class Parameters:
    """Values as last answered by the autopilot."""

    def __init__(self, table: Sequence[Parameter], flavour: ModuleType, requests: Requests, counts: Counter[str]):
        """`table`: the autopilot's parameters with the scene's values."""
        self._table = {p.name: p for p in sorted(table, key=lambda p: p.name)}
        self._number = {name: k for k, name in enumerate(self._table)}
        self._values = {name: p.default for name, p in self._table.items()}
        self._flavour, self._requests, self._counts = flavour, requests, counts
        self._lists: dict[Client, int] = {}  # lists on their way: the next index of each

    def start_list(self, client: Client) -> None:
        """Send all, a few at a time."""
        self._lists[client] = 0

    def step(self) -> None:
        """Go on with the lists."""
        names = list(self._table)
        for client, begin in list(self._lists.items()):
            for name in names[begin : begin + PER_STEP]:
                self.send(client, name)
            self._lists[client] = begin + PER_STEP
            if begin + PER_STEP >= len(names):
                del self._lists[client]

    def forget(self, client: Client) -> None:
        """A client is gone."""
        self._lists.pop(client, None)

    def read(self, client: Client, name: str, index: int) -> None:
        """Send one, by its name or its index."""
        if index != BY_NAME:
            name = list(self._table)[index] if 0 <= index < len(self._table) else ""
        if name in self._table:
            self.send(client, name)
        else:
            self._refuse(client, name, index, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)

    def set(self, client: Client, name: str, value: float, trusted: bool) -> None:
        """Ask the autopilot for a new value; the client hears what it is then."""
        parameter = self._table.get(name)
        if parameter is None:
            self._refuse(client, name, BY_NAME, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)
            return
        wanted = self._flavour.param_value(value, parameter.whole)

        def answered(answer: Any) -> None:
            if answer.result == mavlink.MAV_RESULT_ACCEPTED:
                self._values[name] = answer.value
            else:
                self._refuse(client, name, BY_NAME, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)
            self.send(client, name)

        if not trusted:
            self._refuse(client, name, BY_NAME, mavlink.MAV_PARAM_ERROR_PERMISSION_DENIED)
            self.send(client, name)
        elif not math.isfinite(wanted):
            self._refuse(client, name, BY_NAME, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)
            self.send(client, name)
        else:
            self._requests.ask("parameter", client.name, answered, (wanted,), name)

    def send(self, client: Client, name: str) -> None:
        """Say what a parameter is."""
        integer = self._table[name].whole
        kind = mavlink.MAV_PARAM_TYPE_INT32 if integer else mavlink.MAV_PARAM_TYPE_REAL32
        value = self._flavour.param_float(self._values[name], integer)
        client.send(
            mavlink.MAVLink_param_value_message(name.encode(), value, kind, len(self._table), self._number[name])
        )

    def _refuse(self, client: Client, name: str, index: int, error: int) -> None:
        self._counts["parameter refused"] += 1
        client.send(mavlink.MAVLink_param_error_message(client.system, client.component, name.encode(), index, error))
