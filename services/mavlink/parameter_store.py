"""Autopilot parameters for endpoints: numbered, typed, and always acknowledged."""

import math
import struct
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.command_queue import CommandQueue
from lapwing.services.mavlink.endpoint import Endpoint
from lapwing.services.mavlink.firmware import Firmware
from lapwing.services.mavlink.px4_facts import Fact
from lapwing.services.mavlink.vehicle_description import VehicleDescription

TYPE_MISMATCH, WRITE_FAIL = 7, 9  # MAV_PARAM_ERROR that pymavlink lacks
BY_NAME = -1  # index of a request by name; PX4 accepts any negative one
MAX_PER_STEP = 20  # values of a list sent to one endpoint at each step of the telemetry


class ParameterStore:
    """Parameters of the autopilot with their last acknowledged values, and facts of the vehicle."""

    def __init__(
        self,
        description: VehicleDescription,
        firmware: Firmware,
        commands: CommandQueue,
        broadcast: Callable[[Any], None],
        counts: Counter[str],
    ):
        """Create a store with the autopilot's initial values.

        Args:
            description: vehicle.
            firmware: firmware, which defines the encoding of integers and further facts.
            commands: queue of commands to the autopilot.
            broadcast: sends a message to every endpoint.
            counts: rejected messages by reason.
        """
        self._table = {p.name: p for p in description.parameters}
        self._facts = {f.name: f for f in firmware.facts(description) if f.name not in self._table}
        self.names = sorted([*self._table, *self._facts])  # in the order of their indices
        self._number = {name: k for k, name in enumerate(self.names)}
        self._values = {name: p.default for name, p in self._table.items()}
        self._firmware, self._commands, self._broadcast, self._counts = firmware, commands, broadcast, counts
        self._set_facts: dict[
            str, float
        ] = {}  # values that were set; valid while their counterparts have the corresponding values
        self._repetitions: dict[str, int] = {}  # changed parameters to send again, with the number of steps until then
        self._lists: dict[Endpoint, int] = {}  # next index of each active list

    def value(self, name: str) -> float:
        """Return a parameter's value; NaN if there is no such parameter."""
        fact = self._facts.get(name)
        if fact is None:
            return self._values.get(name, math.nan)
        set_value = self._set_facts.get(name)
        if set_value is not None and fact.assign is not None:
            counterparts = fact.assign(set_value)
            if counterparts is not None and all(self._values.get(k) == v for k, v in counterparts.items()):
                return set_value
        return fact.value(self._values)

    def start_list(self, endpoint: Endpoint) -> None:
        """Start to send all parameters, a few at a time."""
        self._lists[endpoint] = 0

    def step(self) -> None:
        """Continue the lists, and send changed parameters again.

        PX4 sends a changed parameter twice, some milliseconds apart; MAVSDK's subscriptions need the second one.
        """
        if not (self._repetitions or self._lists):
            return
        for name, steps in list(self._repetitions.items()):
            self._repetitions[name] = steps - 1
            if steps <= 1:
                del self._repetitions[name]
                self._broadcast(self._message(name))
        for endpoint, begin in list(self._lists.items()):
            for name in self.names[begin : begin + MAX_PER_STEP]:
                self._send(endpoint, name)
            self._lists[endpoint] = begin + MAX_PER_STEP
            if begin + MAX_PER_STEP >= len(self.names):
                del self._lists[endpoint]

    def forget(self, endpoint: Endpoint) -> None:
        """Remove an endpoint."""
        self._lists.pop(endpoint, None)

    def read(self, endpoint: Endpoint, name: str, index: int) -> None:
        """Send one parameter, by its name or its index."""
        if index >= 0:
            name = self.names[index] if index < len(self.names) else ""
        if name in self._number:
            self._send(endpoint, name)
        else:
            self._reject(endpoint, name, index, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)

    def set(self, endpoint: Endpoint, name: str, value: float, kind: int, trusted: bool) -> None:
        """Request a new value of a MAV_PARAM_TYPE from the autopilot, then send the result to every endpoint."""
        bytewise = self._firmware.PARAMETER_ENCODING == mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
        if name in self._number and bytewise and kind != self._kind(name):
            self._reject(endpoint, name, BY_NAME, TYPE_MISMATCH)
            self._send(endpoint, name)
            return
        if name in self._facts:
            self._set_fact(endpoint, self._facts[name], value, trusted)
            return
        parameter = self._table.get(name)
        if parameter is None:
            self._reject(endpoint, name, BY_NAME, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST)
            return
        decoded = self._firmware.param_value(value, parameter.integer)
        requested = _restore_bound(decoded, parameter.least, parameter.most)

        def on_acknowledgement(acknowledgement: Any) -> None:
            if acknowledgement.result == mavlink.MAV_RESULT_ACCEPTED:
                self._change(name, acknowledgement.value)
            else:
                is_invalid = acknowledgement.result == mavlink.MAV_RESULT_DENIED  # otherwise it is starting or busy
                error = mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE if is_invalid else WRITE_FAIL
                self._reject(endpoint, name, BY_NAME, error)
                self._send(endpoint, name)

        if not trusted:
            self._reject(endpoint, name, BY_NAME, mavlink.MAV_PARAM_ERROR_PERMISSION_DENIED)
            self._send(endpoint, name)
        elif not math.isfinite(requested):
            self._reject(endpoint, name, BY_NAME, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)
            self._send(endpoint, name)
        else:
            self._request(endpoint, name, requested, on_acknowledgement)

    def _set_fact(self, endpoint: Endpoint, fact: Fact, value: float, trusted: bool) -> None:
        """Set the counterparts of a fact, one after another."""
        set_value = self._firmware.param_value(value, fact.integer)
        counterparts = fact.assign(set_value) if fact.assign and math.isfinite(set_value) else None
        error = None
        if fact.assign is None and set_value == fact.value(self._values):
            self._send(endpoint, fact.name)  # as PX4 acknowledges its present value
            return
        if fact.assign is None:
            error = mavlink.MAV_PARAM_ERROR_READ_ONLY
        elif not trusted:
            error = mavlink.MAV_PARAM_ERROR_PERMISSION_DENIED
        elif counterparts is None or not all(
            name in self._table and self._table[name].allows(v) for name, v in counterparts.items()
        ):
            error = mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
        if error is not None or counterparts is None:
            self._reject(endpoint, fact.name, BY_NAME, error or mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE)
            self._send(endpoint, fact.name)
            return
        before = self.value(fact.name)
        self._set_facts[fact.name] = set_value
        pending = {name: v for name, v in counterparts.items() if self._values[name] != v}
        if not pending:
            self._announce(fact.name)
            return

        def on_acknowledgement(name: str, acknowledgement: Any) -> None:
            del pending[name]
            if acknowledgement.result == mavlink.MAV_RESULT_ACCEPTED:
                self._change(name, acknowledgement.value)
            if not pending and self.value(fact.name) == before:  # otherwise `_change` has sent it
                self._announce(fact.name)

        for name, v in list(pending.items()):
            self._request(endpoint, name, v, partial(on_acknowledgement, name))

    def _request(self, endpoint: Endpoint, name: str, value: float, on_acknowledgement: Callable[[Any], None]) -> None:
        """Request a value from the autopilot, at its start if it has not started."""
        allowed = self._table[name].allows(value)
        self._commands.put("parameter", endpoint.name, on_acknowledgement, (value,), name, surely_accepted=allowed)

    def _announce(self, name: str) -> None:
        """Send a changed parameter to every endpoint, and again at the next step."""
        self._broadcast(self._message(name))
        self._repetitions[name] = 1

    def _change(self, name: str, value: float) -> None:
        """Send the new value, and the facts that depend on it, to every endpoint."""
        previous = {fact: self.value(fact) for fact in self._facts}
        self._values[name] = value
        for changed in (name, *[fact for fact in self._facts if self.value(fact) != previous[fact]]):
            self._announce(changed)

    def _send(self, endpoint: Endpoint, name: str) -> None:
        endpoint.send(self._message(name))

    def _message(self, name: str) -> Any:
        kind = self._kind(name)
        value = self._firmware.param_float(self.value(name), kind == mavlink.MAV_PARAM_TYPE_INT32)
        return mavlink.MAVLink_param_value_message(name.encode(), value, kind, len(self.names), self._number[name])

    def _kind(self, name: str) -> int:
        """Return the MAV_PARAM_TYPE of a parameter."""
        integer = (self._table.get(name) or self._facts[name]).integer
        kind: int = mavlink.MAV_PARAM_TYPE_INT32 if integer else mavlink.MAV_PARAM_TYPE_REAL32
        return kind

    def _reject(self, endpoint: Endpoint, name: str, index: int, error: int) -> None:
        self._counts["parameter rejected"] += 1
        endpoint.send(
            mavlink.MAVLink_param_error_message(endpoint.system, endpoint.component, name.encode(), index, error)
        )


def _restore_bound(value: float, *bounds: float) -> float:
    """Return the bound whose 32-bit float equals `value`, otherwise the value."""
    return next((bound for bound in bounds if struct.unpack("<f", struct.pack("<f", bound))[0] == value), value)
