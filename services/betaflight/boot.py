"""Start of Betaflight SITL: configuration through its command line, restart, and calibration at rest."""

import socket
import time
from collections.abc import Callable

from lapwing.cosim.processes.patience import Patience
from lapwing.services.betaflight import msp
from lapwing.services.betaflight.msp import FirmwareStatus, Msp
from lapwing.services.betaflight.packets import Ports
from lapwing.services.betaflight.resolve import PilotSetup
from lapwing.services.common.firmware.link import FirmwareError, Waits
from lapwing.services.common.firmware.program import Program
from lapwing.services.common.firmware.setup import FirmwareSetup

MODES = ("aux 0 0 0 1700 2100 0 0", "aux 1 1 1 1700 2100 0 0")  # ARM on channel 5, ANGLE on channel 6
FEED_EVERY = 0.004  # [s] between two packets at rest
POLL_EVERY = 0.2  # [s]
IGNORED = ("arm switch", "not disarmed")  # reasons that disappear when the arm switch opens
PROMPT = "# "  # end of the command line's output
NOT_READY = ("starting",)  # reasons of a firmware that got RC channels too early, and ignores them from then on
RC_TIMEOUT = 15.0  # [s] from the start; the firmware is ready after 5 s
REPEAT = 2.0  # [s] without an answer after which the command line is requested again
SAVE_TIMEOUT = 30.0  # [s] from `save` to the exit of the program


class IncompleteStart(FirmwareError):
    """Part of the firmware has not started; a restart resolves this."""


def start(setup: FirmwareSetup, waits: Waits) -> Program | None:
    """Start and configure the program. Return None if it is started elsewhere.

    Raises:
        FirmwareError: the program cannot be started, another one runs, or it rejects a line of the configuration.
    """
    if not setup.command:
        return None
    port = Ports.of(setup).msp
    if _listens(setup.host, port):
        message = f"betaflight: TCP port {port} is in use: another Betaflight runs"
        raise FirmwareError(f"{message}; end it, or leave autopilot.command out to use it")
    program = Program(setup)
    try:
        _configure(setup, program, waits)
        program.restart()
    except BaseException:
        program.close()
        raise
    return program


def connect(setup: FirmwareSetup, program: Program | None, waits: Waits) -> Msp:
    """Return an MSP connection to the running firmware.

    Raises:
        FirmwareError: nothing listens within `start_timeout`.
    """
    port = Ports.of(setup).msp
    patience = Patience(setup.start_timeout, program.pid if program else None)
    while not patience.over:
        waits(f"Betaflight at {setup.host}:{port}")
        if program:
            program.check(" at its start")
            if f"bind port {port} for UART1 failed" in program.text():
                raise IncompleteStart(f"betaflight: cannot open TCP port {port}")
        try:
            return Msp(setup.host, port)
        except OSError:
            time.sleep(0.05)
    start_it = f"start betaflight_SITL.elf {setup.host}, or set autopilot.command"
    advice = "check autopilot.command" if program else start_it
    raise FirmwareError(f"betaflight: no answer at {setup.host}:{port} after {setup.start_timeout:g} s; {advice}")


def settle(
    setup: FirmwareSetup,
    link: Msp,
    program: Program | None,
    feed: Callable[[bool], None],
    waits: Waits,
    can_restart: bool = False,
) -> FirmwareStatus:
    """Send the state of a vehicle at rest to the firmware until it can be armed.

    Args:
        setup: configuration with the time-out.
        link: connection for the status.
        program: the program, if Lapwing runs it.
        feed: sends the state, and RC channels if its argument is True.
        waits: see `FirmwareLink`.
        can_restart: the program can be started again.

    Raises:
        IncompleteStart: it does not receive RC channels, and `can_restart` is True.
        FirmwareError: it cannot be armed within `start_timeout`; the text has its reasons.
    """
    patience = Patience(setup.start_timeout, program.pid if program else None)
    rc_patience = Patience(RC_TIMEOUT, program.pid if program else None)
    status, next_poll = None, 0.0
    while not patience.over:
        waits("Betaflight's calibration")
        if program:
            program.check(" at its start")
        feed(status is not None)  # RC channels before the start of the firmware would disable them
        for command, payload in link.poll():
            if command == msp.STATUS:
                status = msp.parse_status(payload)
        if status and not set(status.blockers).difference(IGNORED):
            return status
        if can_restart and rc_patience.over and (status is None or status.blockers == NOT_READY):
            raise IncompleteStart(f"betaflight: does not {'receive RC channels' if status else 'answer by MSP'}")
        if (now := time.monotonic()) >= next_poll:
            next_poll = now + POLL_EVERY
            link.send(msp.request(msp.STATUS))
        time.sleep(FEED_EVERY)
    reasons = ", ".join(status.blockers) if status else "no answer by MSP"
    message = f"betaflight: cannot be armed after {setup.start_timeout:g} s ({reasons})"
    raise FirmwareError(f"{message}; check its configuration")


def _listens(host: str, port: int) -> bool:
    try:
        socket.create_connection((host, port), timeout=0.5).close()
    except OSError:
        return False
    return True


def _configure(setup: FirmwareSetup, program: Program, waits: Waits) -> None:
    """Write the configuration through the command line; `save` ends the program."""
    link = connect(setup, program, waits)
    try:
        _command(link, "#", program, waits)  # alone: a further byte would cancel it
        _command(link, "version\n", program, waits)  # completes the line of a second "#", a comment
        for line in lines(setup):
            answer = _command(link, f"{line}\n", program, waits)
            if "###ERROR" in answer or "Invalid" in answer:
                text = " ".join(answer.replace("\r", "").split())
                raise FirmwareError(f"betaflight: rejects the line {line!r} ({text}); check autopilot.parameters")
        link.send(b"save\n")
        patience = Patience(SAVE_TIMEOUT, program.pid)
        while program.running:
            waits("Betaflight's configuration")
            if patience.over:
                raise FirmwareError(f"betaflight: does not restart within {SAVE_TIMEOUT:g} s after `save`")
            time.sleep(0.02)
    finally:
        link.close()


def _command(link: Msp, line: str, program: Program, waits: Waits) -> str:
    """Send a line and return the answer up to the next prompt."""
    link.send(line.encode())
    answer, patience = "", Patience(SAVE_TIMEOUT, program.pid)
    sent = time.monotonic()
    while not answer.endswith(PROMPT):
        waits("Betaflight's command line")
        program.check(" at its configuration")
        if patience.over:
            raise FirmwareError(f"betaflight: no answer to {line!r} of its command line within {SAVE_TIMEOUT:g} s")
        time.sleep(0.005)
        answer += link.text()
        if line == "#" and not answer and time.monotonic() - sent > REPEAT:  # a firmware that starts may lose it
            link.send(line.encode())
            sent = time.monotonic()
    return answer


def lines(setup: FirmwareSetup) -> list[str]:
    """Return the lines for the firmware's command line; those of the scene come last and take precedence."""
    pilot: PilotSetup = setup.own
    rate = round(pilot.yaw_rate_limit_deg / 10.0)
    required = [
        "map AETR1234",
        *MODES,
        "set acc_calibration = 0,0,0,1",  # a virtual sensor has no offset
        "set yaw_motors_reversed = OFF",
        "set deadband = 0",
        "set yaw_deadband = 0",
        "set rc_smoothing = OFF",
        # the firmware's derivative assumes its nominal loop time, and is too strong where its loop gets less CPU
        *(f"set {key}_{axis} = 5" for key in ("d", "d_max") for axis in ("roll", "pitch")),
        f"set angle_limit = {round(pilot.tilt_limit_deg)}",
        "rateprofile 0",
        "set rates_type = ACTUAL",  # linear: equal rate at the centre and at the end, no expo
        *(f"set {axis}_{key} = {rate}" for axis in ("roll", "pitch", "yaw") for key in ("rc_rate", "srate")),
        *(f"set {axis}_expo = 0" for axis in ("roll", "pitch", "yaw")),
    ]
    own = [line for line in setup.parameter_text.splitlines() if line.strip() and not line.startswith("#")]
    return required + own + [f"set {name} = {value:g}" for name, value in setup.parameters.items()]
