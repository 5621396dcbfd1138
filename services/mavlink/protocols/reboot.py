"""MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN."""

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.protocols.commands import ACCEPTED, DENIED, Command, DeniedError, Outcome, rule
from lapwing.services.mavlink.session import Session

NOTHING, REBOOT = 0, 1  # action on the autopilot


@rule(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN)
def reboot(session: Session, c: Command) -> Outcome:
    """Restart the link, only while disarmed, as in PX4. The autopilot continues: its start is that of the run."""
    action = int(c.params[0])
    if action == REBOOT and not session.vehicle.status.armed:
        session.restart()
        return ACCEPTED
    if action == REBOOT:
        raise DeniedError("Reboot denied: disarm first")
    return ACCEPTED if action == NOTHING else DENIED
