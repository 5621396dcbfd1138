"""Rate of the firmware's clock: set by the times of two packets, and measured, on a firmware with simulated time."""

import struct

import pytest

from lapwing.services.betaflight import msp
from lapwing.services.betaflight.clock import slow_down
from lapwing.services.common.firmware.link import FirmwareError

BEGIN = 1.0  # [s] time of the earlier packets


class Firmware:
    """Clock of Betaflight SITL (sitl.c): rate = time between two packets / time between their arrivals."""

    def __init__(self, late=(), latency=0.03, answers=True):
        """Create the clock; `late`: delays [s] of the arrival of packets with a new time, by number."""
        self.now, self.rate, self.time = 0.0, 1.0, 100.0
        self._late, self._latency, self._answers = list(late), latency, answers
        self._stamp, self._arrived = BEGIN, 0.0
        self._date, self._replies = None, []

    def sleep(self, duration):
        self.now += duration
        self.time += self.rate * duration

    def packet(self, stamp):
        late = self._late.pop(0) if self._late else 0.0
        if stamp > self._stamp:
            self.rate = (stamp - self._stamp) / (self.now + late - self._arrived)
        self._stamp, self._arrived = stamp, self.now + late

    def send(self, data):
        size, command = data[3], data[4]
        if not self._answers:
            return
        if command == msp.SET_RTC:
            self._date = struct.unpack_from("<i", data, 5)[0] - self.time
        elif command == msp.RTC:
            assert size == 0
            self._replies.append(self.now + self._latency / self.rate)

    def poll(self):
        due = [at for at in self._replies if at <= self.now]
        self._replies = [at for at in self._replies if at > self.now]
        whole = self.time + (self._date or 0.0)
        seconds = int(whole) % 86400
        payload = struct.pack("<HBBBBBH", 2001, 9, 9, seconds // 3600, seconds // 60 % 60, seconds % 60,
                              int(1000 * (whole % 1)))  # fmt: skip
        return [(msp.RTC, payload)] * len(due)


def slow(firmware, rate):
    return slow_down(rate, firmware, firmware.packet, lambda _: None, BEGIN, lambda: firmware.now, firmware.sleep)


@pytest.mark.parametrize("rate", [0.02, 0.1, 0.5, 0.9])
def test_rate_is_set_and_measured(rate):
    firmware = Firmware()
    measured, stamp = slow(firmware, rate)
    assert firmware.rate == pytest.approx(0.95 * rate)
    assert measured == pytest.approx(firmware.rate, rel=0.05)
    assert 0.0 < stamp - BEGIN < 0.02  # the firmware ignores longer steps


def test_late_packet_is_repeated():
    firmware = Firmware(late=[0.095])  # the first of two packets, which makes the clock 20 times too fast
    measured, stamp = slow(firmware, 0.1)
    assert measured == pytest.approx(0.095, rel=0.05)
    assert stamp > BEGIN + 0.01


def test_msp_time_is_parsed():
    reply = bytes.fromhex("d1070909012e280a00")  # 2001-09-09 01:46:40.010
    assert msp.parse_time(reply) == pytest.approx(6400.01)


def test_firmware_without_date_is_reported():
    with pytest.raises(FirmwareError, match="does not report its time by MSP"):
        slow(Firmware(answers=False), 0.1)


def test_clock_that_stays_fast_is_reported():
    with pytest.raises(FirmwareError, match=r"its clock runs at 1.9 instead of 0.1 after 20 attempts"):
        slow(Firmware(late=[0.095, 0.0] * 500), 0.1)
