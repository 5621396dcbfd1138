"""Adapter and fake vehicle without sockets or threads; the test advances the time."""

import random

from fake_vehicle import PARAMETERS, PERIOD, FakeVehicle

from lapwing.messages import OperatorInput
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.adapter import Adapter
from lapwing.services.mavlink.resolve import describe
from lapwing.services.scene_resolver import load


class Bench:
    """Vehicle, its adapter, and connected stations."""

    period = PERIOD  # [s] of a step

    def __init__(self, *overrides, recorded=False, starting=False, **options):
        self.vehicle = FakeVehicle()
        put = None if recorded else lambda command: self.vehicle.operate(OperatorInput(commands=(command,)).encode())
        self.adapter = Adapter(
            describe(load("lapwing/scenes/hover.toml", overrides))._replace(parameters=PARAMETERS), put, **options
        )
        self.adapter.commands.started = not starting
        self.stations = []

    @property
    def counts(self):
        return self.adapter.counts

    def station(self, **more):
        station = Station(self, **more)
        self.stations.append(station)
        return station

    def step(self, count=1):
        """Run `count` steps of the telemetry; wall time equals simulation time."""
        for _ in range(count):
            for topic, message in self.vehicle.messages():
                self.adapter.handle(topic, self.vehicle.time_ns, message.encode(), self.vehicle.seconds)
            for station in self.stations:
                station.step()

    def until(self, condition, seconds=10.0):
        for _ in range(round(seconds / self.period)):
            if condition():
                return True
            self.step()
        return bool(condition())


class Station:
    """Client with a lossy link: a share of the datagrams is lost, some arrive twice."""

    def __init__(self, bench, loss=0.0, twice=0.0, seed=0, local=True, system=255, key=None, link=0, heartbeat=True):
        self.codec = mavlink.MAVLink(None, system, 190)
        self.codec.robust_parsing = True
        if key:
            self.codec.signing.secret_key, self.codec.signing.sign_outgoing = key, True
            self.codec.signing.timestamp = bench.adapter.signature.state.timestamp
            self.codec.signing.link_id = link
        self.bench, self.loss, self.twice = bench, loss, twice
        self.random = random.Random(seed)
        self.got, self.sent = [], []
        self.endpoint = bench.adapter.connect(local, True, self._receive)
        if heartbeat:  # required before commands
            self.endpoint.last_heartbeat = bench.adapter.clock.now
        self.on_message = lambda message: None  # called with each message

    def _times(self):
        return 0 if self.random.random() < self.loss else 2 if self.random.random() < self.twice else 1

    def _receive(self, data):
        for _ in range(self._times()):
            for message in self.codec.parse_buffer(data) or ():
                self.got.append(message)
                self.on_message(message)

    def step(self):
        """Hook called at each step of the telemetry."""

    def raw(self, data):
        self.sent.append(data)
        for _ in range(self._times()):
            self.bench.adapter.receive(self.endpoint, data)

    def send(self, kind, *fields, **more):
        message = getattr(mavlink, f"MAVLink_{kind}_message")(*fields, **more)
        self.raw(message.pack(self.codec))
        self.codec.seq = (self.codec.seq + 1) % 256

    def all(self, kind):
        return [m for m in self.got if m.get_type() == kind]

    def last(self, kind):
        result = self.all(kind)
        return result[-1] if result else None

    def command(self, number, *params, seconds=3.0):
        """Send a command once. Return its result."""
        self.got.clear()
        self.send("command_long", 1, 1, number, 0, *params, *[0.0] * (7 - len(params)))
        self.bench.until(lambda: self.last("COMMAND_ACK"), seconds)
        ack = self.last("COMMAND_ACK")
        assert ack is None or (ack.target_system, ack.target_component) == (255, 190)
        return ack and ack.result


def item(seq, command=16, frame=6, kind=0, north=10.0, up=5.0, params=(0.0, 0.0, 0.0, float("nan"))):
    """Return the fields of a MISSION_ITEM_INT."""
    latitude = round((40.7686 + north / 111_000) * 1e7)
    return 1, 1, seq, frame, command, 0, 1, *params, latitude, 147907000, up, kind
