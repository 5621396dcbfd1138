"""Link to Betaflight SITL: UDP for state, RC and motors, MSP for status.

The firmware has no lock step. One that Lapwing starts runs in turns (`repeatable.c`): its clock moves by one tick with
each state packet, and it answers when it has nothing more to do at this time. Any other runs in real time.

The firmware would set the rate of its clock by the time between two packets of increasing time. All packets therefore
carry the same time.
"""

import socket
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from lapwing.kernels import math
from lapwing.services.betaflight import boot, msp
from lapwing.services.betaflight.packets import Ports, parse_motors, rc_packet, state_packet
from lapwing.services.betaflight.pilot import OFF, Pilot, Sticks
from lapwing.services.betaflight.resolve import PilotConfig
from lapwing.services.betaflight.state_source import StateSource
from lapwing.services.common import ports
from lapwing.services.common.firmware.firmware_config import FirmwareConfig
from lapwing.services.common.firmware.link import FirmwareOutput, ProgramLink, Read
from lapwing.services.common.firmware.program import TCP, UDP, OwnPort
from lapwing.services.common.firmware.repeatable import Turns
from lapwing.services.common.firmware.service import firmware_service

TIME = 1.0  # [s] in all packets
RC_EVERY = 0.01  # [s]
STARTS = 3  # most starts of a program of which a part does not start
STATUS_EVERY = 0.2  # [s]
FEED_EVERY = 0.004  # [s] between two packets at rest in real time
RUNNING = 0.02  # motor output above which the vehicle is armed
REPLY = 0.05  # [s] longest wait for motor outputs before the state is sent again
LONG_REPLY = 0.2  # [s] of one wait in turns
PEER_TIMEOUT = 1.0  # [s] of silence after which another firmware may take over
LOST = "no position: descends level and lands"
FASTEST = 0.8  # shortest fraction of an interval between two packets in real time
IDLE = b"idle"  # answer of the library if the firmware sends no motor outputs
BOOT = 6_000_000_000  # [ns] of the firmware's clock until the first packet
READING = 100  # [ns] by which a reading moves the firmware's clock


class BetaflightLink(ProgramLink):
    """Connection to one Betaflight SITL."""

    ADVICE = "stop the other program that uses it; a campaign needs --workers 1"

    def __init__(self, config: FirmwareConfig) -> None:
        """Store the configuration."""
        super().__init__(config)
        self._ports = Ports.of(config)
        kinds = zip((self._ports.state, self._ports.rc, self._ports.msp), (UDP, UDP, TCP), strict=True)
        self.OWN_PORTS = tuple(OwnPort(kind, port, 0) for port, kind in kinds)
        pilot: PilotConfig = config.own
        self._source, self._pilot = StateSource(pilot, config.start_world), Pilot(pilot, config.start_world)
        self._msp: msp.Msp | None = None
        self._socket: socket.socket | None = None
        self._status = msp.FirmwareStatus(False, (), 0.0)
        self._outputs: tuple[float, ...] = (0.0,) * 4
        self._sender: tuple[str, int] | None = None  # sender of the motor outputs
        self._armed = False
        self._output_at = 0.0  # [s] wall time of the last motor outputs
        self._next = 0.0  # [s] wall time of the next packet in real time
        self._rc_at = self._status_at = -math.inf  # [s] simulation time
        self._sticks = OFF

    def _claim(self) -> None:
        self._socket = self._bound(UDP, self._ports.motors)

    def _peer(self) -> tuple[int, int] | None:
        return (UDP, self._ports.state)

    def _begin(self) -> None:
        """Start the firmware or wait for it, and calibrate it."""
        ports, turns = self._ports, None
        if self._config.command:
            self._start()
            assert self.program is not None
            self._complete(partial(boot.configure, self._config, self.program, self._waits))
            turns = Turns(
                "b", ports.state, self._config.interval_ns, (ports.msp, ports.motors), IDLE, ports.motors,
                start_ns=BOOT, read_ns=READING,
            )  # fmt: skip
            self.program.restart(self._prepare(turns))
        self._complete(self._calibrate, turns)

    def _complete(self, start: Callable[[], None], turns: Turns | None = None) -> None:
        """Call `start`; call it again with a new program if part of this one has not started."""
        for left in reversed(range(STARTS)):
            try:
                start()
                return
            except boot.IncompleteStart as error:
                if not left or not self.program:
                    raise
                self.report.note(f"started again: {error}")
                if self._msp:
                    self._msp.close()
                self.program.stop()
                self.program.restart(turns and self._prepare(turns))
                self._sender = None

    def _calibrate(self) -> None:
        """Connect to the firmware, and let it calibrate its sensors."""
        assert self._socket is not None
        self._socket.settimeout(0.0)
        with suppress(OSError):
            while self._socket.recv(2048):  # sent by the program before its restart
                pass

        def feed(with_rc: bool) -> None:
            self._send(OFF if with_rc else None)
            if self.in_turns:
                self._await()
            else:
                self._drain(0.0)
                time.sleep(FEED_EVERY)

        self._take_turns("ready")
        self._msp = boot.connect(self._config, self.program, self._waits)
        self._status = boot.settle(self._config, self._msp, self.program, feed, self._waits)

    def step(self, tick: int, read: Read) -> FirmwareOutput:
        """Send state and sticks at the time of the tick, and return the newest motor outputs."""
        interval = self._config.interval
        t = self._time = tick * interval
        self._sticks = self._pilot.step(t, interval, read(ports.TRAJECTORY), self._source.update(t, read))
        if not self.in_turns:
            self._pace(interval)
        self._drain(0.0)  # outputs since the last reply are older than this tick
        if t >= self._rc_at + RC_EVERY:
            self._rc_at = t
            self._send(self._sticks)
        else:
            self._send(None)
        start = time.monotonic()
        if self.in_turns:
            self._await()
        elif not self._drain(REPLY):
            self.report.missed += 1
            self._await()
        self.report.waiting += time.monotonic() - start
        self._poll_status(t)
        return self._output()

    def _pace(self, interval: float) -> None:
        """Wait until `interval` [s] of wall time after the last packet; a late packet shifts all later ones."""
        now = time.monotonic()
        self._next = self._next or now
        time.sleep(max(0.0, self._next - now))
        self.report.late += now > self._next + interval
        self._next = max(self._next + interval, now + FASTEST * interval)

    def close(self) -> None:
        """Close the connections and end the program."""
        if self._msp:
            self._msp.close()
        super().close()
        if self._socket:
            self._socket.close()
        self._msp = self._socket = None

    def _send(self, sticks: Sticks | None) -> None:
        assert self._socket is not None
        with suppress(OSError):  # the firmware does not run; `step` detects its silence
            if sticks:  # first, since the state ends a turn
                self._socket.sendto(rc_packet(TIME, tuple(sticks)), (self._config.host, self._ports.rc))
            self._socket.sendto(state_packet(TIME, self._source.state), (self._config.host, self._ports.state))

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
                host, port = sender
                self.report.reject(f"a second Betaflight ({host}:{port}) sent motor outputs, which are ignored")
                return False
            self.report.reconnected += 1
        try:
            self._outputs = self._outputs if data == IDLE and self.in_turns else parse_motors(data)
        except ValueError as error:
            self.report.reject(f"malformed motor outputs: {error}")
            return False
        self._sender, self._output_at = sender, now
        return True

    def _await(self) -> None:
        """Wait for motor outputs: the simulation pauses while the firmware gets no CPU.

        The state is sent again in real time, where the system may have lost a packet.

        Raises:
            FirmwareError: the firmware has been silent for too long, or has ended.
        """
        if self.in_turns and self._drain(LONG_REPLY):
            return
        timeout = self._config.step_timeout
        for _ in self._attempts("Betaflight's motor outputs", timeout):
            if not self.in_turns:
                self.report.resent += 1
                self._send(self._sticks)
            if self._drain(LONG_REPLY if self.in_turns else REPLY):
                return
        self._time_out(f"no motor outputs for {timeout:g} s", "the firmware has stalled or ended")

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
        if self._pilot.lost:
            text = LOST
        elif stage in ("flying", "landing") and not armed:
            text = "disarmed in flight"
        blockers = tuple(b for b in self._status.blockers if b not in boot.IGNORED)
        landed = stage in ("waiting", "landed")
        finished = self._pilot.finished and not armed
        return FirmwareOutput(
            self._outputs, armed, landed, finished, f"angle ({stage})", text, blockers,
            self._pilot.attitude_reference, follows=stage in ("waiting", "flying"),
        )  # fmt: skip


create = partial(firmware_service, name="betaflight", link=BetaflightLink)
