"""Rate of the firmware's clock, in its seconds per second of wall time.

The firmware sets the rate of its clock to the time difference of two state packets over the wall time between their
arrivals (sitl.c, updateState), and keeps it while the times are equal. With a slow clock, the firmware and Lapwing get
more CPU time for each loop on a busy machine. The arrival times are unknown here, so the rate is measured afterwards
from the firmware's date and time (MSP_RTC).
"""

import struct
import time
from collections.abc import Callable

from lapwing.services.betaflight import msp
from lapwing.services.betaflight.msp import Msp
from lapwing.services.common.firmware.link import FirmwareError, Waits

STEP = 0.01  # [s] between the times of the two packets; the firmware ignores 0.02 and more
GAP = 0.2  # [s] longest wall time between the two packets; 0.5 would reset the firmware's link
SHARE = 0.95  # target rate over the desired one
LEAST, GREATEST = 0.3, 1.05  # accepted rates over the desired one
ATTEMPTS = 20
ACCURACY = 0.03  # relative, of the measured rate
RESOLUTION = 0.001  # [s] of the firmware's time
LONGEST = 30.0  # [s] wall time of a measurement
FEED_EVERY = 0.02  # [s] between two state packets
START = 1_000_000_000  # [s] date sent to the firmware: 2001-09-09 01:46:40


def slow_down(
    rate: float,
    link: Msp,
    send: Callable[[float], None],
    waits: Waits,
    begin: float,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> tuple[float, float]:
    """Slow the firmware's clock down.

    Args:
        rate: desired rate, below 1.
        link: MSP connection.
        send: sends a state packet with a time [s].
        waits: see `FirmwareLink`.
        begin: [s] time of the last state packet.
        clock: wall time [s].
        sleep: pauses for a time [s].

    Returns:
        Measured rate, and the time [s] that all further state packets must have.

    Raises:
        FirmwareError: the rate cannot be measured, or is wrong after 20 attempts.
    """
    stamp, actual = begin, 0.0
    for _ in range(ATTEMPTS):
        waits("Betaflight's clock")
        send(stamp)
        send_time = clock()
        sleep(min(GAP, STEP / rate))
        stamp += min(SHARE * rate * (clock() - send_time), STEP)
        send(stamp)
        actual = _measure(link, lambda last=stamp: send(last), waits, clock, sleep)  # type: ignore[misc]
        if LEAST * rate <= actual <= GREATEST * rate:
            return actual, stamp
    raise FirmwareError(
        f"betaflight: its clock runs at {actual:.3g} instead of {rate:g} after {ATTEMPTS} attempts; "
        "the machine is too busy, or set betaflight.clock_rate = 1"
    )


def _measure(
    link: Msp, feed: Callable[[], None], waits: Waits, clock: Callable[[], float], sleep: Callable[[float], None]
) -> float:
    """Return the rate of the firmware's clock."""
    link.send(msp.request(msp.SET_RTC, struct.pack("<iH", START, 0)))
    first: tuple[float, float, float] | None = None  # [s] wall time before and after, firmware's time
    start = clock()
    while clock() < start + LONGEST:
        waits("Betaflight's clock")
        last = _read(link, feed, clock, sleep)
        if last is None:
            continue
        if first is None or last[2] < first[2]:  # read before the date was set
            first = last
        elapsed = 0.5 * (last[0] + last[1] - first[0] - first[1])
        firmware_time = last[2] - first[2]
        if min(elapsed, firmware_time) <= 0.0:
            continue
        uncertainty = 0.5 * (last[1] - last[0] + first[1] - first[0]) / elapsed + RESOLUTION / firmware_time
        if uncertainty < ACCURACY:
            return firmware_time / elapsed
    raise FirmwareError("betaflight: does not report its time by MSP; set betaflight.clock_rate = 1")


def _read(
    link: Msp, feed: Callable[[], None], clock: Callable[[], float], sleep: Callable[[float], None]
) -> tuple[float, float, float] | None:
    """Return wall times before and after, and the firmware's time [s], or None without an answer."""
    before = clock()
    link.send(msp.request(msp.RTC))
    while clock() < before + 1.0:
        sleep(FEED_EVERY)
        feed()
        for command, payload in link.poll():
            if command == msp.RTC:
                return before, clock(), msp.parse_time(payload)
    return None
