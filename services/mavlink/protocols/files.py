"""The file transfer protocol's message."""

from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.protocols.handler import handles
from lapwing.services.mavlink.session import Session


@handles("FILE_TRANSFER_PROTOCOL")
def file_transfer(session: Session, m: Any) -> None:
    """Serve a file request; all endpoints may read the files."""
    for payload in session.files.replies(bytes(m.payload)):
        session.send(mavlink.MAVLink_file_transfer_protocol_message(0, *session.address, list(payload)))
