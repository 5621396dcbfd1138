"""Start of Betaflight SITL: configuration through its command line, restart, and calibration at rest."""

import itertools
import time
from collections.abc import Callable

from lapwing.cosim.processes.patience import Patience
from lapwing.services.betaflight import msp
from lapwing.services.betaflight.msp import FirmwareStatus, Msp
from lapwing.services.betaflight.packets import Ports
from lapwing.services.betaflight.resolve import PilotConfig
from lapwing.services.common.firmware.firmware_config import FirmwareConfig
from lapwing.services.common.firmware.link import Waits
from lapwing.services.common.firmware.program import FirmwareError, Program

MODES = ("aux 0 0 0 1700 2100 0 0", "aux 1 1 1 1700 2100 0 0")  # ARM on channel 5, ANGLE on channel 6
FIRST_REQUEST = 0.1  # [s] of wall time until the system has delivered the connection and its first request
POLL_EVERY = 50  # packets at rest between two requests of the status
IGNORED = ("arm switch", "not disarmed")  # reasons that disappear when the arm switch opens
PROMPT = "# "  # end of the command line's output
NOT_READY = ("starting",)  # reasons of a firmware that got RC channels too early, and ignores them from then on
RC_TIMEOUT = 15.0  # [s] from the start, also of the command line; the firmware is ready after 5 s
REPEAT = 2.0  # [s] without an answer after which the command line is requested again
SAVE_TIMEOUT = 30.0  # [s] from `save` to the exit of the program


class IncompleteStart(FirmwareError):
    """Part of the firmware has not started; a restart resolves this."""


def connect(config: FirmwareConfig, program: Program | None, waits: Waits) -> Msp:
    """Return an MSP connection to the running firmware.

    Raises:
        FirmwareError: nothing listens within `start_timeout`.
    """
    port = Ports.of(config).msp
    patience = Patience(config.start_timeout, program.pid if program else None, pauses=True)
    while not patience.over:
        waits(f"Betaflight at {config.host}:{port}")
        if program:
            program.check(" at its start")
            if f"bind port {port} for UART1 failed" in program.text():
                raise IncompleteStart(f"betaflight: cannot open TCP port {port}")
        try:
            return Msp(config.host, port)
        except OSError:
            time.sleep(0.05)
    start_it = f"start betaflight_SITL.elf {config.host}, or set autopilot.command"
    advice = "check autopilot.command" if program else start_it
    raise FirmwareError(f"betaflight: no answer at {config.host}:{port} after {config.start_timeout:g} s; {advice}")


def settle(
    config: FirmwareConfig,
    link: Msp,
    program: Program | None,
    feed: Callable[[bool], None],
    waits: Waits,
) -> FirmwareStatus:
    """Send the state of a vehicle at rest to the firmware until it can be armed.

    Args:
        config: configuration with the time-out.
        link: connection for the status.
        program: the program, if Lapwing runs it.
        feed: sends the state, and RC channels if its argument is True; waits a time step.
        waits: see `FirmwareLink`.

    Raises:
        IncompleteStart: the program, if Lapwing runs it, does not receive RC channels.
        FirmwareError: it cannot be armed within `start_timeout`; the text has its reasons.
    """
    patience = Patience(config.start_timeout, program.pid if program else None, pauses=True)
    rc_patience = Patience(RC_TIMEOUT, program.pid if program else None, pauses=True)
    status = None
    for count in itertools.count():
        if patience.over:
            break
        waits("Betaflight's calibration")
        if program:
            program.check(" at its start")
        if count % POLL_EVERY == 0:
            link.send(msp.request(msp.STATUS))
            time.sleep(0.0 if count else FIRST_REQUEST)
        feed(status is not None)  # RC channels before the start of the firmware would disable them
        for command, payload in link.poll() if (count + 1) % POLL_EVERY == 0 else ():  # long after its arrival
            if command == msp.STATUS:
                status = msp.parse_status(payload)
        if status and not set(status.blockers).difference(IGNORED):
            return status
        if program and rc_patience.over and (status is None or status.blockers == NOT_READY):
            raise IncompleteStart(f"betaflight: does not {'receive RC channels' if status else 'answer by MSP'}")
    reasons = ", ".join(status.blockers) if status else "no answer by MSP"
    message = f"betaflight: cannot be armed after {config.start_timeout:g} s ({reasons})"
    raise FirmwareError(f"{message}; check its configuration")


def configure(config: FirmwareConfig, program: Program, waits: Waits) -> None:
    """Write the configuration through the command line; `save` ends the program.

    Raises:
        IncompleteStart: its command line does not answer.
        FirmwareError: the program rejects a line of the configuration.
    """
    link = connect(config, program, waits)
    try:
        _command(link, "#", program, waits)  # alone: a further byte would cancel it
        _command(link, "version\n", program, waits)  # completes the line of a second "#", a comment
        for line in lines(config):
            answer = _command(link, f"{line}\n", program, waits)
            if "###ERROR" in answer or "Invalid" in answer:
                text = " ".join(answer.replace("\r", "").split())
                raise FirmwareError(f"betaflight: rejects the line {line!r} ({text}); check autopilot.parameters")
        link.send(b"save\n")
        patience = Patience(SAVE_TIMEOUT, program.pid, pauses=True)
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
    answer, patience = "", Patience(RC_TIMEOUT, program.pid, pauses=True)
    sent = time.monotonic()
    while not answer.endswith(PROMPT):
        waits("Betaflight's command line")
        program.check(" at its configuration")
        if patience.over:
            raise IncompleteStart(f"betaflight: no answer to {line!r} of its command line within {RC_TIMEOUT:g} s")
        time.sleep(0.005)
        answer += link.text()
        if line == "#" and not answer and time.monotonic() - sent > REPEAT:  # a firmware that starts may lose it
            link.send(line.encode())
            sent = time.monotonic()
    return answer


def lines(config: FirmwareConfig) -> list[str]:
    """Return the lines for the firmware's command line; those of the scene come last and take precedence."""
    pilot: PilotConfig = config.own
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
    own = [line for line in config.parameter_text.splitlines() if line.strip() and not line.startswith("#")]
    return required + own + [f"set {name} = {value:g}" for name, value in config.parameters.items()]
