"""Packet schedule: ticks per packet and ticks between packets from one service to another.

A service whose inputs all have a delay of d ticks runs ahead of the others by up to d ticks, as the trajectory does. No
service waits for its single ticks, so its packets hold d / 2 ticks. Every loop through it contains those d ticks, and
the two packets delay a message by less, so that the lock step cannot deadlock.

A consumer that reads only ports with a period of n ticks gets a packet every n ticks, for example the autopilot from
the battery.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.transport.bus_keys import STEP_KEY


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
