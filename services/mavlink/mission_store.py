"""Missions, fences and rally points of the vehicle, from MAVLink messages, and active uploads."""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.geo_coordinates import Datum, degrees
from lapwing.services.common.mavlink.mission_export import to_mavlink
from lapwing.services.common.plans.converter import convert, notes
from lapwing.services.common.plans.item_converters import MAX_ITEMS
from lapwing.services.common.plans.plan_item import PlanItem, RefusedItemError
from lapwing.services.mavlink.announcements import statustext
from lapwing.services.mavlink.clock import Clock
from lapwing.services.mavlink.command_queue import CommandQueue
from lapwing.services.mavlink.endpoint import Endpoint
from lapwing.services.mavlink.mission_upload import Repeat, Upload


def plan_items(messages: Sequence[Any], home_first: bool) -> list[PlanItem]:
    """Return the items of MISSION_ITEM_INT messages in order.

    Args:
        messages: one for each item.
        home_first: True if ground stations count from home, the first item, as with ArduPilot; otherwise they show the
            first item as 1.
    """
    return [
        PlanItem(
            m.seq if home_first else m.seq + 1,
            m.seq,
            m.command,
            m.frame,
            (m.param1, m.param2, m.param3, m.param4),
            degrees(m.x),
            degrees(m.y),
            m.z,
            bool(m.autocontinue),
        )
        for m in messages
    ]


MAX_WARNINGS = 10  # texts about skipped items
KINDS = {  # command to the autopilot
    mavlink.MAV_MISSION_TYPE_MISSION: "mission_upload",
    mavlink.MAV_MISSION_TYPE_FENCE: "fence_upload",
    mavlink.MAV_MISSION_TYPE_RALLY: "rally_upload",
}
_KIND_OF = {command: kind for kind, command in KINDS.items()} | {"mission_clear": mavlink.MAV_MISSION_TYPE_MISSION}
_RECENT = 64  # uploads and acknowledgements that wait for their counterpart
_RESULTS = {
    mavlink.MAV_RESULT_ACCEPTED: mavlink.MAV_MISSION_ACCEPTED,
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED: mavlink.MAV_MISSION_DENIED,
    mavlink.MAV_RESULT_DENIED: mavlink.MAV_MISSION_DENIED,
    mavlink.MAV_RESULT_UNSUPPORTED: mavlink.MAV_MISSION_UNSUPPORTED,
}


class MissionStore:
    """Stored items of each kind, and active uploads."""

    def __init__(
        self, clock: Clock, commands: CommandQueue, datum: Callable[[], Datum], home_first: bool, counts: Counter[str]
    ):
        """Create an empty store.

        Args:
            clock: clock of the link.
            commands: queue of commands to the autopilot.
            datum: returns the reference of coordinates.
            home_first: True if the first item of a mission is home, as in ArduPilot.
            counts: rejected messages by reason.
        """
        self._clock, self._commands, self._datum = clock, commands, datum
        self._home_first, self._counts = home_first, counts
        self.items: dict[int, list[Any]] = {kind: [] for kind in KINDS}  # as sent by the endpoint
        self._uploads: dict[int, Upload] = {}
        self._finished: dict[int, tuple[Endpoint, int]] = {}  # endpoint and result of the last upload
        self._repeats: dict[int, Repeat] = {}  # repetitions of last acknowledgements, which may be lost
        self._observed: deque[Any] = deque(maxlen=_RECENT)  # uploads of other senders
        self._accepted: deque[tuple[str, int]] = deque(maxlen=_RECENT)  # source and number of commands

    def begin(self, endpoint: Endpoint, kind: int, count: int) -> None:
        """Start an upload of `count` items."""
        self._repeats.pop(kind, None)
        upload = self._uploads.get(kind)
        if upload and upload.endpoint is not endpoint:
            self._counts["upload while another endpoint uploads"] += 1
            self._acknowledge(endpoint, kind, mavlink.MAV_MISSION_DENIED)
        elif upload and upload.complete:
            return  # a repeated message: the acknowledgement is pending
        elif kind not in KINDS:
            self._acknowledge(endpoint, kind, mavlink.MAV_MISSION_UNSUPPORTED)
        elif count > MAX_ITEMS:
            self._counts["too many items"] += 1
            self._acknowledge(endpoint, kind, mavlink.MAV_MISSION_NO_SPACE)
        else:
            upload = self._uploads[kind] = Upload(endpoint, kind, count, self._clock)
            self._continue(upload)

    def add_item(self, endpoint: Endpoint, m: Any) -> None:
        """Handle an item of an upload: the next one, one out of order, or a repeated one."""
        upload = self._uploads.get(m.mission_type)
        if upload is None or upload.endpoint is not endpoint:
            self._counts["item without a request"] += 1
            last_endpoint, result = self._finished.get(m.mission_type, (None, 0))
            if last_endpoint is endpoint:  # the acknowledgement was lost
                self._acknowledge(endpoint, m.mission_type, result)
        elif upload.complete or m.seq < len(upload.items):
            self._counts["repeated item"] += 1
        elif m.seq > len(upload.items):
            self._counts["item out of order"] += 1
            self._request_next(upload)
        else:
            upload.append(m)
            self._continue(upload)

    def forget(self, endpoint: Endpoint, kind: int | None = None) -> None:
        """Stop repeating the last acknowledgement to an endpoint that has disconnected or starts another transfer."""
        for other, repeat in list(self._repeats.items()):
            if repeat.endpoint is endpoint and kind in (None, other):
                del self._repeats[other]

    def cancel(self, endpoint: Endpoint, kind: int) -> None:
        """Cancel the upload of an endpoint."""
        upload = self._uploads.get(kind)
        if upload and upload.endpoint is endpoint and not upload.complete:
            del self._uploads[kind]

    def clear(self, endpoint: Endpoint, kind: int) -> None:
        """Delete the items of a kind."""
        if kind == mavlink.MAV_MISSION_TYPE_ALL:
            for other in KINDS:
                if other not in self._uploads:
                    self._submit(Upload(endpoint, other, 0, self._clock), acknowledged_kind=kind)
        else:
            self.begin(endpoint, kind, 0)

    def observe(self, commands: Iterable[Any], acknowledgements: Iterable[Any]) -> None:
        """Store uploads of other senders that the autopilot accepts."""
        self._observed += (c for c in commands if c.kind in _KIND_OF)
        self._accepted += ((a.source, a.id) for a in acknowledgements if a.result == mavlink.MAV_RESULT_ACCEPTED)
        for command in [c for c in self._observed if (c.source, c.id) in self._accepted]:
            self._observed.remove(command)
            self.store(command)

    def store(self, command: Any) -> None:
        """Store the items of an upload command that the autopilot has accepted."""
        if command.kind in _KIND_OF:
            kind = _KIND_OF[command.kind]
            self.items[kind] = to_mavlink(command.items, kind, self._datum())

    def step(self) -> None:
        """Repeat requests for missing items until the limit; repeat the last acknowledgements."""
        if not (self._repeats or self._uploads):
            return
        for kind, repeat in list(self._repeats.items()):
            if repeat.due():
                self._acknowledge(repeat.endpoint, kind, repeat.result)
            if repeat.over:
                del self._repeats[kind]
        for upload in [u for u in self._uploads.values() if u.overdue]:
            if upload.timed_out:
                self._counts["upload timed out"] += 1
                self._end(upload, mavlink.MAV_MISSION_OPERATION_CANCELLED)
            else:
                upload.note_lost_request()
                self._request_next(upload)

    def _continue(self, upload: Upload) -> None:
        if len(upload.items) < upload.count:
            self._request_next(upload)
            return
        self._submit(upload)

    def _request_next(self, upload: Upload) -> None:
        target = upload.endpoint.system, upload.endpoint.component
        upload.endpoint.send(mavlink.MAVLink_mission_request_int_message(*target, upload.next_request(), upload.kind))

    def _submit(self, upload: Upload, acknowledged_kind: int | None = None) -> None:
        """Send the complete items to the autopilot, or reject them."""
        received = plan_items(upload.items, self._home_first)
        try:
            items = convert(received, upload.kind, self._datum(), self._home_first)
        except RefusedItemError as error:
            self._counts["invalid item"] += 1
            _send_text(upload.endpoint, mavlink.MAV_SEVERITY_ERROR, f"Upload rejected: {error}")
            self._end(upload, error.result)
            return
        upload.complete = True

        def on_acknowledgement(acknowledgement: Any) -> None:
            if acknowledgement.result == mavlink.MAV_RESULT_IN_PROGRESS:
                return
            if acknowledgement.result == mavlink.MAV_RESULT_ACCEPTED:
                self.items[upload.kind] = upload.items
                for text in notes(received)[:MAX_WARNINGS]:
                    _send_text(upload.endpoint, mavlink.MAV_SEVERITY_WARNING, text)
            self._end(upload, _RESULTS.get(acknowledgement.result, mavlink.MAV_MISSION_ERROR), acknowledged_kind)

        self._commands.put(KINDS[upload.kind], upload.endpoint.name, on_acknowledgement, items=items)

    def _end(self, upload: Upload, result: int, acknowledged_kind: int | None = None) -> None:
        self._uploads.pop(upload.kind, None)
        self._finished[upload.kind] = upload.endpoint, result
        if upload.count:
            self._repeats[upload.kind] = Repeat(upload, result, self._clock)
        if acknowledged_kind is None or upload.kind == max(
            KINDS
        ):  # clearing all kinds has one acknowledgement, at its end
            self._acknowledge(upload.endpoint, upload.kind if acknowledged_kind is None else acknowledged_kind, result)

    def _acknowledge(self, endpoint: Endpoint, kind: int, result: int) -> None:
        endpoint.send(mavlink.MAVLink_mission_ack_message(endpoint.system, endpoint.component, result, kind))


def _send_text(endpoint: Endpoint, severity: int, text: str) -> None:
    for message in statustext(severity, text):
        endpoint.send(message)
