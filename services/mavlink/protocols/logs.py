"""Log transfer and console, which this vehicle lacks; their clients are told so, rather than left to wait."""

from typing import Any

from services.mavlink.dialect import mavlink
from services.mavlink.protocols.handler import handles
from services.mavlink.session import Session


@handles("LOG_REQUEST_LIST")
def list_no_logs(session: Session, m: Any) -> None:
    """There are none to fetch: the log of a run is the MCAP file."""
    session.send(mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0))


@handles("LOG_REQUEST_DATA")
def send_no_log_data(session: Session, m: Any) -> None:
    """The end of a log that is not there."""
    session.send(mavlink.MAVLink_log_data_message(m.id, m.ofs, 0, [0] * 90))


@handles("LOG_ERASE", "LOG_REQUEST_END")
def ignore(session: Session, m: Any) -> None:
    """Nothing to be done, as there is no log."""


@handles("SERIAL_CONTROL")
def refuse_console(session: Session, m: Any) -> None:
    """No console: an empty reply."""
    session.send(mavlink.MAVLink_serial_control_message(m.device, mavlink.SERIAL_CONTROL_FLAG_REPLY, 0, 0, 0, [0] * 70))
