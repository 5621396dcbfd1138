"""Transfer of files and of the run's log, and rejection of console requests."""

from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.protocols import handles
from lapwing.services.mavlink.session import Session


@handles("LOG_REQUEST_LIST")
def list_logs(session: Session, m: Any) -> None:
    """Send the entry of this run's log with its current size, or an empty entry without a log."""
    session.send(session.log.entries(m.start, m.end))


@handles("LOG_REQUEST_DATA")
def send_log_data(session: Session, m: Any) -> None:
    """Send bytes of the log from an offset; every endpoint may read all files."""
    session.log.request(m.id, m.ofs, m.count)


@handles("LOG_REQUEST_END")
def stop(session: Session, m: Any) -> None:
    """Stop sending the log."""
    session.log.stop()


@handles("LOG_ERASE")
def reject_erasure(session: Session, m: Any) -> None:
    """Reject the erasure of the run's log with a text."""
    session.send_text("LOG_ERASE: the log of a run cannot be erased")


@handles("SERIAL_CONTROL")
def reject_console(session: Session, m: Any) -> None:
    """Answer a console request with an empty reply: the vehicle has no console."""
    session.send(mavlink.MAVLink_serial_control_message(m.device, mavlink.SERIAL_CONTROL_FLAG_REPLY, 0, 0, 0, [0] * 70))


@handles("FILE_TRANSFER_PROTOCOL")
def file_transfer(session: Session, m: Any) -> None:
    """Serve a file request; all endpoints may read the files."""
    for payload in session.files.replies(bytes(m.payload)):
        session.send(mavlink.MAVLink_file_transfer_protocol_message(0, *session.address, list(payload)))
