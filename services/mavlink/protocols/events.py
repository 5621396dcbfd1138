"""The Events Interface's request for what has got lost."""

from typing import Any

from services.mavlink.protocols.handler import handles
from services.mavlink.session import Session


@handles("REQUEST_EVENT")
def request_events(session: Session, m: Any) -> None:
    """Events once more; free to everybody, as all telemetry."""
    for message in session.vehicle.events.replies(m.first_sequence, m.last_sequence, session.address):
        session.send(message)
