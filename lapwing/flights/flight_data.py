"""Data of a flight, recorded or simulated in memory: topics over time, and metrics."""

from collections.abc import Collection, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from lapwing.cosim.config.provenance import DIVERGED, FAILURE
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.cosim.log import LogReader
from lapwing.flights import tracking
from lapwing.flights.accident import with_causes
from lapwing.flights.contacts import Neighbours, Touch, contacts
from lapwing.flights.flight_events import (
    IMU_SELECTION,
    Event,
    events,
    imu_failures,
    in_order,
    refusals,
    slack,
    with_crash,
)
from lapwing.flights.flight_provenance import Origin
from lapwing.flights.flight_topics import FlightTracking
from lapwing.flights.mission import Mission, mission_of
from lapwing.flights.outcome import LANDED, FlightOutcome, classify
from lapwing.flights.port_columns import columns_of
from lapwing.flights.topic_view import TopicView
from lapwing.messages import TYPES
from lapwing.messages.topics import (
    ACTUATORS,
    BATTERY,
    BODIES,
    COMMAND_ACKS,
    CONTACT,
    ESTIMATE,
    ESTIMATE_COVARIANCE,
    EVENTS,
    LIFT,
    RANGEFINDER,
    SETPOINT,
    SONAR,
    STATUS,
    TRUTH,
    Topic,
    custom_sensor,
    template_topic,
)
from lapwing.services.common import ports

IN_SPACE = (TRUTH, BODIES, CONTACT, SETPOINT, ACTUATORS, SONAR, RANGEFINDER)  # topics for drawing a vehicle in 3D
FLEET_TOPICS = (*IN_SPACE, STATUS)  # topics of the other vehicles of a fleet: for drawing, and for their outcomes

# Topics for outcome, events, metrics and report.
SHOWN = (
    *IN_SPACE,
    STATUS,
    COMMAND_ACKS,
    ESTIMATE,
    ESTIMATE_COVARIANCE,
    LIFT,
    BATTERY,
    EVENTS,
    custom_sensor(ports.IMU_SELECTION),
)


class FlightData(FlightTracking):
    """Recorded topics of a flight, and the metrics derived from them.

    The first axis of `flight.truth.position` is time, at `flight.truth.times`; `flight.topic(NAME)` is any topic.

    Attributes:
        origin: log or run configuration, with the log's metadata.
        vehicle: name of the vehicle.
        name: name of the flight in a comparison; "": the name of its log.
        fleet: "ground_truth" of every vehicle by name, including this one.
        others: flights of the other vehicles, with the topics for drawing and outcome.
        drawn: values of the varied keys of a campaign.
        failure: reason of an early end; "" without one, or if the log has none.
        diverged: True if that reason is a non-finite state.
    """

    def __init__(self, topics: Mapping[str, TopicView], origin: Origin, failure: str = "", diverged: bool = False):
        """Create a flight from topics by name without that of the vehicle: "ground_truth", "gps/fix", "clock"."""
        super().__init__(topics, origin)
        self.failure, self.diverged = failure, diverged
        self.name, self.drawn = "", dict[str, Any]()
        self.fleet = {self.vehicle: self._topics["ground_truth"]} if "ground_truth" in self._topics else {}
        self.others: tuple[FlightData, ...] = ()

    @classmethod
    def read(cls, path: str | Path, vehicle: str | None = None, only: Collection[Topic] | None = None) -> Self:
        """Read a recorded flight.

        Args:
            path: path of the MCAP log.
            vehicle: name; by default that of the first topic /NAME/ground_truth.
            only: topics to read; None: all.

        Raises:
            ValueError: the file is missing or not an MCAP log, it has no flight, or a message is damaged.
        """
        with LogReader(path) as log:
            names = [name for name, kind in log.topics().items() if kind in TYPES]
            fleet = _vehicles(names, log.metadata)
            selected = vehicle or next(iter(fleet), None)
            if selected is None:
                raise ValueError(f"{path}: no flight in this log (no topic /NAME/ground_truth)")
            if selected not in fleet:
                expected = f"one of {', '.join(fleet)}" if fleet else "a log of a flight"
                raise ValueError(f"{path}: no flight in this log of a vehicle {selected}; expected {expected}")
            others = {topic.key(name) for name in fleet for topic in FLEET_TOPICS}
            own = [name for name in names if name.startswith(f"/{selected}/") or "/" not in name[1:] or name in others]
            return cls._of_log(log, str(path), log.histories(_select_names(own, only, fleet)), selected, fleet)

    @classmethod
    def read_all(cls, path: str | Path, only: Collection[Topic] | None = None) -> list[Self]:
        """Read the flights of all vehicles in one pass over the log.

        Args:
            path: path of the MCAP log.
            only: topics to read of every vehicle; None: all.

        Raises:
            ValueError: see `read`.
        """
        with LogReader(path) as log:
            names = [name for name, kind in log.topics().items() if kind in TYPES]
            fleet = _vehicles(names, log.metadata)
            if not fleet:
                raise ValueError(f"{path}: no flight in this log (no topic /NAME/ground_truth)")
            histories = log.histories(_select_names(names, only, fleet))
            return [cls._of_log(log, str(path), histories, name, fleet) for name in fleet]

    @classmethod
    def _of_log(cls, log: LogReader, source: str, histories: Mapping[str, Any], vehicle: str, fleet: list[str]) -> Self:
        failure, diverged = log.metadata.get(FAILURE, ""), log.metadata.get(DIVERGED) == "yes"

        def of(name: str, keys: Collection[str]) -> Any:
            views = {key.removeprefix(f"/{name}").removeprefix("/"): TopicView(*histories[key]) for key in keys}
            return cls(views, Origin.of_log(source, name, log.metadata, log.attachments), failure, diverged)

        result: Self = of(vehicle, [key for key in histories if key.startswith(f"/{vehicle}/") or "/" not in key[1:]])
        shown = {name: [key for topic in FLEET_TOPICS if (key := topic.key(name)) in histories] for name in fleet}
        result.others = tuple(of(name, shown[name]) for name in fleet if name != vehicle)
        everyone: dict[str, FlightData] = {result.vehicle: result} | {one.vehicle: one for one in result.others}
        for flight in result.others:
            flight.others = tuple(other for other in everyone.values() if other is not flight)
        result.fleet = {name: everyone[name].truth for name in fleet}
        return result

    @classmethod
    def of(
        cls, diagram: BlockDiagram, only: Collection[Topic] | None = None, failure: str = "", diverged: bool = False
    ) -> Self:
        """Return a flight that was simulated in this process.

        Args:
            diagram: block diagram at the end, with the full history of these topics.
            only: topics to keep; None: all recorded ones.
            failure: reason of an early end.
            diverged: True if the reason is a non-finite state.
        """
        views = {_short(topic): TopicView(times_ns, columns) for topic, times_ns, columns in columns_of(diagram, only)}
        return cls(views, Origin.of_config(diagram.config), failure, diverged)

    @classmethod
    def of_each(
        cls, diagram: BlockDiagram, only: Collection[Topic] | None = None, failure: str = "", diverged: bool = False
    ) -> list[Self]:
        """Return the flights of all vehicles of a run. See `of` for arguments."""
        if diagram.config.vehicle:
            return [cls.of(diagram, only, failure, diverged)]
        all_views = [(topic, TopicView(times_ns, columns)) for topic, times_ns, columns in columns_of(diagram, only)]
        result = []
        for own in members(diagram.config):
            views = {
                _short(template_topic(topic)): view for topic, view in all_views if topic.vehicle in ("", own.vehicle)
            }
            result.append(cls(views, Origin.of_config(own), failure, diverged))
        truths = {flight.vehicle: flight.truth for flight in result if flight.has("ground_truth")}
        for flight in result:
            flight.fleet, flight.others = truths, tuple(other for other in result if other is not flight)
        return result

    def __repr__(self) -> str:
        text = str(self.outcome) if len(self.truth) else "no ground truth"
        return f"<Flight of {self.metadata.get('scene', self.origin.source)}: {text}>"

    @cached_property
    def located(self) -> bool:
        """True if the log has a position of the vehicle; an imported flight may have none."""
        return bool(np.isfinite(self.truth.position).any())

    @property
    def energy(self) -> float:
        """Electrical energy consumed by the motors [J]."""
        return tracking.total(self.truth.motor_power) * self.config.interval

    @cached_property
    def finished(self) -> bool:
        """True if the autopilot reports the end of the mission."""
        return self.has("status") and bool(self.status.finished[-1])

    @cached_property
    def mission(self) -> Mission | None:
        """Mission of the vehicle; None without one, or without a readable run configuration."""
        try:
            return mission_of(self.config, self.truth.position[0])
        except ValueError:
            return None

    @cached_property
    def outcome(self) -> FlightOutcome:
        """End of the flight; see `FlightOutcome` for its kinds."""
        is_incomplete = self.origin.recorded and not self.digest
        failure = self.failure or ("the log is incomplete" if is_incomplete else "")
        status = self.status if self.has("status") else None
        setpoint = self.setpoint if self.has("setpoint") else None
        mission = None if status is None else self.mission
        return with_causes(classify(self.truth, status, failure, self.diverged, mission, self.contacts, setpoint), self)

    @cached_property
    def contacts(self) -> list[Touch]:
        """Contacts with the ground, obstacles and other vehicles, in order of time."""
        return contacts(self.truth, self.origin.scene, self.neighbours)

    @property
    def neighbours(self) -> Neighbours:
        """True state and scene of the other vehicles of a fleet, by name."""
        located = [other for other in self.others if other.has("ground_truth")]
        return {other.vehicle: (other.truth, other.origin.scene) for other in located}

    @cached_property
    def events(self) -> list[Event]:
        """Events in order of time, with a crash, and the alarms after it marked as its consequences."""
        if self.has("events"):
            recorded = self.topic("events")
            return [Event(*event) for event in zip(recorded.times.tolist(), recorded.name, recorded.msg, strict=True)]
        return with_crash(self.occurrences, self.outcome) if len(self.truth) else self.occurrences

    @property
    def occurrences(self) -> list[Event]:
        """Events in order of time, without the judgement of the whole flight."""
        status, setpoint = (self.topic(name) if self.has(name) else None for name in ("status", "setpoint"))
        result = events(self.truth, status, setpoint, self.armed, self.origin.scene, self.contacts)
        if self.has(IMU_SELECTION):
            result = in_order([*result, *imu_failures(self.topic(IMU_SELECTION))])
        if self.has("vehicle_command_ack"):
            result = in_order([*result, *refusals(self.topic("vehicle_command_ack"))])
        load = self.origin.scene.get("cooperative_load")
        if load and self.has("body_states") and self.has("rotor_wrench"):  # no autopilot, so no other kinds of events
            result += slack(self.topic("body_states"), self.topic("rotor_wrench"), load)
        return result

    @property
    def landed(self) -> bool:
        """True if the vehicle is upright and at rest on its feet after its mission or a failsafe."""
        return self.outcome.kind in LANDED


def _select_names(names: list[str], only: Collection[Topic] | None, fleet: list[str]) -> list[str]:
    """Return the names in a log that belong to the requested topics."""
    if only is None:
        return names
    selected = {topic.key(name) for topic in only for name in fleet}
    return [name for name in names if name in selected]


def _vehicles(topics: Collection[str], metadata: Mapping[str, str]) -> list[str]:
    """Return the vehicles with ground truth among the topics of a log, in the order of its scene."""
    result = [name.split("/")[1] for name in topics if name.endswith("/ground_truth")]
    order = metadata.get("vehicle", "").split(", ")
    return sorted(result, key=lambda name: order.index(name) if name in order else len(order))


def _short(topic: Topic) -> str:
    """Return the topic's name without the vehicle's."""
    return topic.name.removeprefix("{vehicle}/")
