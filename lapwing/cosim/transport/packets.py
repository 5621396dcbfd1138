"""Packets between services: step packets with the rows of a tick, and log packets with encoded messages.

A step packet contains the rows of the service's ports that are due at the tick, in the order of the run configuration:
little-endian float64 without padding. A packet of several ticks (`packet_schedule`) contains, port by port, all rows
that are due in them. A service without outputs in these ticks sends no packet. An empty packet is the last one.
`layout` describes them for programs in other languages.

A log packet contains all messages of the ticks [start, stop): start and stop (int64 each), then record batches: length
of the topic's name (uint16), number of messages and size of a payload (uint32 each), the name, the ticks (int64 each),
the payloads.

A service whose inputs all have a delay of d ticks runs ahead of the others by up to d ticks, as the trajectory does. No
service waits for its single ticks, so its packets hold d / 2 ticks. Every loop through it contains those d ticks, and
the two packets delay a message by less, so that the lock step cannot deadlock.

A consumer that reads only ports with a period of n ticks gets a packet every n ticks, for example the autopilot from
the battery.
"""

import math
import struct
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.config.serialise import to_json
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import RecordBatch, due_ticks
from lapwing.cosim.transport.bus_keys import ALIVE_KEY, BATCH_KEY, CONFIG_KEY, STEP_KEY, WAITING_KEY
from lapwing.kernels.row_packing import row_width
from lapwing.messages.message_diff import leaves
from lapwing.messages.topics import topic_named

_BATCH = struct.Struct("<HII")
_TICKS = struct.Struct("<qq")


class PacketError(ValueError):
    """Bytes that are not a step packet or log packet of this run."""


class _Rows(NamedTuple):
    """Rows of a port in a step packet."""

    port: str
    period: int
    number: int
    place: slice  # of the numbers of the packet


class StepPacketCodec:
    """Encoder and decoder of the step packets of one service."""

    def __init__(self, ports: Sequence[Port], ticks: int = 1):
        """Create the codec of a service with these ports, in order; a packet holds `ticks` ticks."""
        self._ports = [(port.name, port.period, row_width(port.example)) for port in ports]
        self._periods = sorted({port.period for port in ports})
        self._cycle = math.lcm(*self._periods)  # [ticks] period of the packets' contents
        self._ticks = ticks
        self._by_phase: dict[int, tuple[_Rows, ...]] = {}
        self._known: dict[tuple[int, ...], tuple[_Rows, ...]] = {}  # rows by the number of rows for each period

    def due(self, first: int) -> bool:
        """Return True if a packet starts at the tick `first`."""
        return bool(self._rows(first))

    def size(self, first: int) -> int:
        """Return the size [bytes] of the packet that starts at the tick `first`."""
        rows = self._rows(first)
        return 8 * rows[-1].place.stop if rows else 0

    def pack(self, diagram: BlockDiagram, first: int) -> bytes:
        """Return the packet that starts at the tick `first`, from the rows of a diagram."""
        if self._ticks == 1:
            return b"".join([diagram.row(rows.port, first).tobytes() for rows in self._rows(first)])
        return b"".join([diagram.rows(rows.port, self._due(rows, first)).tobytes() for rows in self._rows(first)])

    def unpack(self, payload: bytes, diagram: BlockDiagram, first: int) -> None:
        """Store the rows of the packet that starts at the tick `first` in a diagram that uses them.

        Raises:
            PacketError: the packet has an unexpected size.
        """
        if len(payload) != self.size(first):
            raise PacketError(f"step packet of {len(payload)} bytes at tick {first}, expected {self.size(first)}")
        numbers = np.frombuffer(payload, "<f8")
        for rows in self._rows(first):
            if not diagram.has(rows.port):
                continue
            if self._ticks == 1:
                diagram.put_row(rows.port, first, numbers[rows.place])
            else:
                diagram.put_rows(rows.port, self._due(rows, first), numbers[rows.place].reshape(rows.number, -1))

    def _due(self, rows: _Rows, first: int) -> np.ndarray:
        return due_ticks(first, first + self._ticks, rows.period)

    def _rows(self, first: int) -> tuple[_Rows, ...]:
        phase = first % self._cycle
        if (rows := self._by_phase.get(phase)) is None:
            rows = self._by_phase[phase] = self._rows_of(phase)
        return rows

    def _rows_of(self, first: int) -> tuple[_Rows, ...]:
        last = first + self._ticks - 1
        numbers = tuple([last // period - (first - 1) // period for period in self._periods])
        if numbers not in self._known:
            by_period = dict(zip(self._periods, numbers, strict=True))
            result, place = [], 0
            for name, period, columns in self._ports:
                if number := by_period[period]:
                    result.append(_Rows(name, period, number, slice(place, place + number * columns)))
                    place += number * columns
            self._known[numbers] = tuple(result)
        return self._known[numbers]


def pack_log_packet(batches: Iterable[RecordBatch], start: int, stop: int) -> bytes:
    """Return a log packet of record batches with all messages of the ticks [start, stop)."""
    parts = [_TICKS.pack(start, stop)]
    for batch in batches:
        payloads = np.ascontiguousarray(batch.payloads)
        size = payloads.nbytes // len(batch.ticks)
        name = batch.topic.name.encode()
        parts += [_BATCH.pack(len(name), len(batch.ticks), size), name, batch.ticks.tobytes(), payloads.tobytes()]
    return b"".join(parts)


def unpack_log_packet(payload: bytes) -> tuple[int, int, list[RecordBatch]]:
    """Return the ticks [start, stop) of a log packet, and its record batches with payloads of shape (n, size).

    Raises:
        PacketError: not a log packet.
    """
    try:
        start, stop = _TICKS.unpack_from(payload)
        place, batches = _TICKS.size, []
        while place < len(payload):
            length, n, size = _BATCH.unpack_from(payload, place)
            place += _BATCH.size
            topic = topic_named(payload[place : place + length].decode())
            place += length
            ticks = np.frombuffer(payload, "<i8", n, place)
            place += 8 * n
            payloads = np.frombuffer(payload, np.uint8, n * size, place).reshape(n, size)
            place += n * size
            batches.append(RecordBatch(topic, ticks, payloads))
        return start, stop, batches
    except (struct.error, ValueError, IndexError) as error:
        raise PacketError(f"log packet of {len(payload)} bytes: {error}") from None


def layout(config: RunConfig) -> dict[str, Any]:
    """Return ports, periods and columns of all services as a tree for JSON.

    Returns:
        "rate" [Hz], "interval_ns", "last_tick", "order" (of the services within a tick), "keys" (the first parts of
        their keys, by purpose), "services" (by name: "inputs", each with "port" and "delay" [ticks], and "ports" in the
        order of a step packet, each with "name", "period" [ticks] and "columns"), and "config", the text of the run
        configuration.
    """
    return {
        "rate": config.rate,
        "interval_ns": config.interval_ns,
        "last_tick": config.last_tick,
        "order": config.order,
        "keys": {
            "step": STEP_KEY,
            "batch": BATCH_KEY,
            "alive": ALIVE_KEY,
            "waiting": WAITING_KEY,
            "config": CONFIG_KEY,
        },
        "services": {
            name: {
                "inputs": [{"port": i.port, "delay": i.delay} for i in service.inputs],
                "ports": [
                    {"name": p.name, "period": p.period, "columns": [column for column, _ in leaves(p.example)]}
                    for p in service.ports
                ],
            }
            for name, service in config.services.items()
        },
        "config": to_json(config),
    }


def ticks_per_packet(config: RunConfig, name: str) -> int:
    """Return the number of ticks that a service steps and publishes at once."""
    delays = [i.delay for i in config.services[name].inputs]
    return max(1, min(delays, default=0) // 2)


class PacketSchedule(NamedTuple):
    """Schedule of the packets from one service to another."""

    ticks: int  # [ticks] in a packet
    every: int  # [ticks] between the starts of two packets; only ports whose period is a multiple

    @property
    def key(self) -> str:
        """Key of its packets, without the name of the sending service."""
        if self.ticks > 1:
            return f"{STEP_KEY}_{self.ticks}"
        return STEP_KEY if self.every == 1 else f"{STEP_KEY}_every_{self.every}"

    def ports(self, ports: Iterable[Port]) -> list[Port]:
        """Return the ports of a service that its packets contain."""
        return [port for port in ports if self.ticks > 1 or port.period % self.every == 0]


EACH_TICK = PacketSchedule(1, 1)
"""A packet at each tick with all outputs of a service."""


def packet_schedule(config: RunConfig, producer: str, consumer: str) -> PacketSchedule:
    """Return the schedule of the packets from one service to a consumer."""
    if (ticks := max(ticks_per_packet(config, producer), ticks_per_packet(config, consumer))) > 1:
        return PacketSchedule(ticks, ticks)
    consumed = {i.port for i in config.services[consumer].inputs}
    periods = [port.period for port in config.services[producer].ports if port.name in consumed]
    return PacketSchedule(1, math.gcd(*periods))


def packet_schedules(config: RunConfig, producer: str) -> set[PacketSchedule]:
    """Return the packet schedules of a service; one packet per tick if it has no consumer."""
    produced = {port.name for port in config.services[producer].ports}
    consumers = [name for name, service in config.services.items() if any(i.port in produced for i in service.inputs)]
    return {packet_schedule(config, producer, consumer) for consumer in consumers} or {EACH_TICK}
