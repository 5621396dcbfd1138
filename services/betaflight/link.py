"""Link to Betaflight SITL: real time, UDP for state, RC and motors, MSP for status.

The firmware would set the rate of its clock by the wall time between two packets of increasing time, which on a busy
machine varies by a factor of 100. All packets therefore carry the same time, so that its clock runs at wall time, or at
`betaflight.clock_rate` times wall time, which is set and measured before the first tick. A late packet shifts all later
ones: a simulation that catches up would be faster than the firmware.
"""

import socket
import time
from contextlib import suppress

from lapwing.kernels import math
from lapwing.services.betaflight import boot, msp
from lapwing.services.betaflight.clock import slow_down
from lapwing.services.betaflight.packets import Ports, parse_motors, rc_packet, state_packet
from lapwing.services.betaflight.pilot import OFF, Pilot, Sticks
from lapwing.services.betaflight.resolve import NAME, PilotSetup
from lapwing.services.betaflight.state_source import StateSource
from lapwing.services.common import ports
from lapwing.services.common.firmware.datagrams import bound_socket
from lapwing.services.common.firmware.link import FirmwareOutput, LinkReport, Read, Waits
from lapwing.services.common.firmware.program import ProgramLink
from lapwing.services.common.firmware.setup import FirmwareSetup

TIME = 1.0  # [s] in all packets, unless the clock is slowed down
RC_EVERY = 0.01  # [s]
STARTS = 3  # starts of the program while it does not receive RC channels
STATUS_EVERY = 0.2  # [s]
RUNNING = 0.02  # motor output above which the vehicle is armed
REPLY = 0.05  # [s] longest wait for motor outputs before the state is sent again
PEER_TIMEOUT = 1.0  # [s] of silence after which another firmware may take over


LATE = 1.0  # intervals after its time at which a packet counts as late
FASTEST = 0.8  # shortest fraction of an interval between two packets


class Pace:
    """Pacing of packets in wall time, with statistics of its accuracy."""

    def __init__(self, report: LinkReport) -> None:
        """Store the report."""
        self._report = report
        self._next = self._sent = 0.0  # [s] of the wall clock
        self._count = self._sum = self._squares = 0.0  # sums of the times [s] between packets

    def wait(self, interval: float, rate: float) -> None:
        """Wait until `interval` [s] after the last packet; `rate`: simulation time per wall time."""
        now, report = time.monotonic(), self._report
        if self._sent == 0.0:
            self._next = now
        if now < self._next:
            time.sleep(self._next - now)
            now = time.monotonic()
        if now - self._next > LATE * interval:
            report.late += 1
        report.skew_max = max(report.skew_max, rate * (now - self._next))
        if self._sent > 0.0:
            self._add(now - self._sent)
        self._sent = now
        self._next = max(self._next + interval, now + FASTEST * interval)

    def _add(self, gap: float) -> None:
        """Add a time [s] between two packets to the statistics."""
        self._count, self._sum, self._squares = self._count + 1, self._sum + gap, self._squares + gap * gap
        mean = self._sum / self._count
        self._report.jitter = math.sqrt(max(0.0, self._squares / self._count - mean * mean))


class BetaflightLink(ProgramLink):
    """Connection to one Betaflight SITL."""

    def __init__(self, setup: FirmwareSetup) -> None:
        """Store the configuration."""
        self._setup, self._ports = setup, Ports.of(setup)
        pilot: PilotSetup = setup.own
        self.report = LinkReport("betaflight", reproducible=False)
        self._source, self._pilot = StateSource(pilot, setup.start_world), Pilot(pilot, setup.start_world)
        self._msp: msp.Msp | None = None
        self._socket: socket.socket | None = None
        self._status = msp.FirmwareStatus(False, (), 0.0)
        self._outputs: tuple[float, ...] = (0.0,) * 4
        self._sender: tuple[str, int] | None = None  # sender of the motor outputs
        self._armed = False
        self._output_at = 0.0  # [s] wall time of the last motor outputs
        self._pace = Pace(self.report)
        self._clock_rate = pilot.clock_rate
        self._stamp = TIME  # [s] in all packets
        self._rate = 1.0  # rate of the firmware's clock
        self._rc_at = self._status_at = -math.inf  # [s] simulation time
        self._sticks = OFF

    def open(self, waits: Waits) -> None:
        """Start the firmware or wait for it, and calibrate it."""
        setup = self._setup
        advice = "stop the other run or simulator that uses it; a campaign needs --workers 1"
        self._socket = bound_socket(NAME, setup.host, self._ports.motors, advice)
        self._program = boot.start(setup, waits)
        self._calibrate(waits)
        if self._clock_rate < 1.0:
            assert self._msp is not None
            self._rate, self._stamp = slow_down(self._clock_rate, self._msp, self._feed, waits, TIME)
            self.report.note(f"the firmware's clock runs at {self._rate:.3g} of real time")

    def _feed(self, stamp: float) -> None:
        """Send the state at rest with a time [s], and RC channels; discard the outputs."""
        self._stamp = stamp
        self._send(OFF)
        self._drain(0.0)

    def _calibrate(self, waits: Waits) -> None:
        """Connect to the firmware and calibrate it; start it again if it does not receive RC channels."""
        setup = self._setup
        assert self._socket is not None
        self._socket.settimeout(0.0)
        with suppress(OSError):
            while self._socket.recv(2048):  # sent by the program before its restart
                pass

        def feed(with_rc: bool) -> None:
            self._send(OFF if with_rc else None)
            self._drain(0.0)

        for left in reversed(range(STARTS if self._program else 1)):
            try:
                self._msp = boot.connect(setup, self._program, waits)
                self._status = boot.settle(setup, self._msp, self._program, feed, waits, left > 0)
                return
            except boot.IncompleteStart as error:
                if not left:
                    raise
                assert self._program is not None
                self.report.note(f"started again: {error}")
                if self._msp:
                    self._msp.close()
                self._program.stop()
                self._program.restart()
                self._sender = None

    def step(self, tick: int, read: Read, waits: Waits) -> FirmwareOutput:
        """Send state and sticks at the time of the tick, and return the newest motor outputs."""
        interval = self._setup.interval
        t = self._time = tick * interval
        motion = self._source.update(t, read)
        self._sticks = self._pilot.step(t, interval, read(ports.TRAJECTORY), motion)
        self._pace.wait(interval / self._rate, self._rate)
        self._drain(0.0)  # outputs since the last reply are older than this tick
        if t >= self._rc_at + RC_EVERY:
            self._rc_at = t
            self._send(self._sticks)
        else:
            self._send(None)
        start = time.monotonic()
        if not self._drain(REPLY):
            self.report.missed += 1
            self._repeat(waits)
        self.report.waiting += time.monotonic() - start
        self._poll_status(t)
        return self._output()

    def close(self) -> None:
        """Close the connections and end the program."""
        if self._msp:
            self._msp.close()
        if self._socket:
            self._socket.close()
        if self._program:
            self._program.close()
        self._program = self._msp = self._socket = None

    def _send(self, sticks: Sticks | None) -> None:
        assert self._socket is not None
        with suppress(OSError):  # the firmware does not run; `step` detects its silence
            self._socket.sendto(state_packet(self._stamp, self._source.state), (self._setup.host, self._ports.state))
            if sticks:
                self._socket.sendto(rc_packet(self._stamp, tuple(sticks)), (self._setup.host, self._ports.rc))

    def _drain(self, timeout: float) -> bool:
        """Receive all pending motor outputs; wait at most `timeout` [s] for the first. Return False if none arrived."""
        assert self._socket is not None
        deadline, result = time.monotonic() + timeout, False
        while True:
            left = deadline - time.monotonic()
            self._socket.settimeout(max(left, 0.0) if not result else 0.0)
            try:
                data, sender = self._socket.recvfrom(2048)
            except OSError:  # none left, or the firmware's port is closed
                if result or time.monotonic() >= deadline:
                    return result
                continue
            result = self._accept(data, sender) or result

    def _accept(self, data: bytes, sender: tuple[str, int]) -> bool:
        """Store motor outputs; count and ignore malformed ones and those of a second firmware."""
        now = time.monotonic()
        if self._sender not in (None, sender):
            if now - self._output_at < PEER_TIMEOUT:
                self.report.rejected += 1
                self.report.note(f"a second Betaflight ({sender[0]}:{sender[1]}) sent motor outputs, which are ignored")
                return False
            self.report.reconnected += 1
        try:
            self._outputs = parse_motors(data)
        except ValueError as error:
            self.report.rejected += 1
            self.report.note(f"malformed motor outputs: {error}")
            return False
        self._sender, self._output_at = sender, now
        return True

    def _repeat(self, waits: Waits) -> None:
        """Send the state again until motor outputs arrive: the simulation pauses while the firmware gets no CPU.

        Raises:
            FirmwareError: the firmware has been silent for too long, or has ended.
        """
        patience = self._patience(self._setup.step_timeout)
        while True:
            waits("Betaflight's motor outputs")
            self._check(patience, "no motor outputs", "the firmware has stalled or ended")
            self.report.resent += 1
            self._send(self._sticks)
            if self._drain(REPLY):
                return

    def _poll_status(self, t: float) -> None:
        assert self._msp is not None
        if t < self._status_at + STATUS_EVERY:
            return
        self._status_at = t
        for command, payload in self._msp.poll():
            if command == msp.STATUS:
                with suppress(ValueError):
                    self._status = msp.parse_status(payload)
        self._msp.send(msp.request(msp.STATUS))

    def _output(self) -> FirmwareOutput:
        armed = max(self._outputs) > RUNNING
        stage = self._pilot.stage
        text = ""
        if stage in ("flying", "landing") and not armed:
            text = "disarmed in flight"
        blockers = tuple(b for b in self._status.blockers if b not in boot.IGNORED)
        landed = stage in ("waiting", "landed")
        finished = self._pilot.finished and not armed
        return FirmwareOutput(
            self._outputs, armed, landed, finished, f"angle ({stage})", text, blockers, self._pilot.attitude_reference
        )
