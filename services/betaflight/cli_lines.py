"""Lines for Betaflight's command line that the adapter needs, and those of the scene."""

from lapwing.services.betaflight.resolve import PilotSetup
from lapwing.services.common.firmware.setup import FirmwareSetup

MODES = ("aux 0 0 0 1700 2100 0 0", "aux 1 1 1 1700 2100 0 0")  # ARM on channel 5, ANGLE on channel 6


def lines(setup: FirmwareSetup) -> list[str]:
    """Return the lines; those of the scene come last, so that they win."""
    pilot: PilotSetup = setup.own
    rate = round(pilot.yaw_rate_limit_deg / 10.0)
    needed = [
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
    return needed + own + [f"set {name} = {value:g}" for name, value in setup.parameters.items()]
