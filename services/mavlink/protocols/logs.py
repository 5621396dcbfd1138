"""Log transfer: the run's own log; and the console, which this vehicle lacks, and says so."""

from typing import Any

from services.mavlink.dialect import mavlink
from services.mavlink.protocols.handler import handles
from services.mavlink.session import Session


@handles("LOG_REQUEST_LIST")
def list_logs(session: Session, m: Any) -> None:
    """The log of this run, as far as it is written; or that there is none."""
    session.send(session.log.entries(m.start, m.end))


@handles("LOG_REQUEST_DATA")
def send_log_data(session: Session, m: Any) -> None:
    """Bytes of it, from now on; reading is free to everybody, as of the other files."""
    session.log.request(m.id, m.ofs, m.count)


@handles("LOG_REQUEST_END")
def stop(session: Session, m: Any) -> None:
    """Enough of it."""
    session.log.stop()


@handles("LOG_ERASE")
def refuse_to_erase(session: Session, m: Any) -> None:
    """The log of a run stays."""
    session.say("LOG_ERASE: the log of a run stays")


@handles("SERIAL_CONTROL")
def refuse_console(session: Session, m: Any) -> None:
    """No console: an empty reply."""
    session.send(mavlink.MAVLink_serial_control_message(m.device, mavlink.SERIAL_CONTROL_FLAG_REPLY, 0, 0, 0, [0] * 70))
