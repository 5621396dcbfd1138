"""Link to Betaflight: faults of a peer are reported without ending the run; a scripted firmware flies."""

import time

import pytest
from betaflight_peer import Peer, free_ports

from lapwing.api.flight import Flight
from lapwing.cosim.log import LogReader
from lapwing.runs.resimulate import resimulate
from lapwing.runs.single_process_run import fly_single
from lapwing.services.betaflight import link
from lapwing.services.betaflight.packets import MOTORS
from lapwing.services.common.firmware.program import FirmwareError
from lapwing.services.scene_resolver import load, resolve

PATIENT = 60.0  # [s] for a busy machine


def config(first, duration=3.0, overrides=(), **keys):
    keys = {"start_timeout": PATIENT, "step_timeout": PATIENT} | keys
    values = [f"autopilot.{key}={value}" for key, value in keys.items()]
    return resolve(
        load("betaflight_quad", [f"autopilot.port={first}", f"run.duration={duration}", *values, *overrides])
    )


def fly(tmp_path, answer=None, duration=3.0, blockers=0, overrides=(), **keys):
    """Return the flight and the log's metadata."""
    first = free_ports()
    log = tmp_path / "flight.mcap"
    with Peer(first, answer, blockers) as peer:
        if answer and hasattr(answer, "peer"):
            answer.peer = peer
        fly_single(config(first, duration, overrides, **keys), log)
    with LogReader(log) as read:
        metadata = dict(read.metadata)
    return Flight.read(log), metadata, peer


def test_scripted_firmware_takes_off_and_log_resimulates(tmp_path):
    flight, metadata, peer = fly(tmp_path)
    assert flight.truth.position[-1, 2] > 0.1
    assert not peer.early
    assert metadata["firmware"].startswith("betaflight: 1501 steps")
    assert "rejected 0" in metadata["firmware"]
    assert metadata["repeatable"] == "no: Lapwing did not start it"
    assert len({state[0] for state in peer.states}) == 1  # equal times keep the firmware's clock at wall time
    resting = peer.states[100]
    assert resting[4:7] == pytest.approx((0.0, 0.0, -9.81), abs=0.5)
    assert resting[11:14] == pytest.approx((0.0, 0.0, 0.0), abs=0.2)
    assert resting[14:16] == pytest.approx((14.7907, 40.7686), abs=1e-4)
    assert resting[17] == pytest.approx(101325.0, rel=0.05)
    before, after = resimulate(tmp_path / "flight.mcap")
    assert before == after


def test_malformed_packets_are_counted_and_reported(tmp_path):
    def answer(n, reply):
        return (
            [reply[:-1], reply + b"\0", b"", MOTORS.pack(float("nan"), 0.0, 0.0, 0.0), reply]
            if n % 100 == 0
            else [reply]
        )

    flight, metadata, _ = fly(tmp_path, answer)
    assert flight.truth.position[-1, 2] > 0.1
    assert "rejected 0" not in metadata["firmware"]
    assert "malformed motor outputs: 15 bytes; expected 16" in metadata["firmware_notes"]
    assert "non-finite motor outputs (nan, 0.0, 0.0, 0.0)" in metadata["firmware_notes"]


def test_second_firmware_is_ignored_and_reported(tmp_path):
    class Answer:
        peer = None

        def __call__(self, n, reply):
            if n > 500:
                self.peer.send(MOTORS.pack(1.0, 0.0, 0.0, 0.0), other=True)
            return [reply]

    flight, metadata, _ = fly(tmp_path, Answer())
    assert flight.truth.position[-1, 2] > 0.1
    assert "a second Betaflight (127.0.0.1:" in metadata["firmware_notes"]
    assert abs(flight.truth.angular_velocity[:, 2]).max() < 1.0


def test_firmware_may_restart(tmp_path):
    class Answer:
        peer = None
        until = 0.0

        def __call__(self, n, reply):
            if n == 400:  # before the vehicle is armed
                self.until = time.monotonic() + 1.5
                self.peer.reopen()
            return [] if time.monotonic() < self.until else [reply]

    flight, metadata, _ = fly(tmp_path, Answer(), duration=4.0)
    assert "reconnected 1" in metadata["firmware"]
    assert flight.truth.position[-1, 2] > 0.1


@pytest.mark.long
def test_lost_position_ends_in_level_landing(tmp_path, monkeypatch):
    monkeypatch.setattr(link, "REPLY", PATIENT)  # on a busy machine an answer would come a packet late
    faults = 'sensors.gps.faults=[{kind="dropout", start=4.0}]'
    flight, _, _ = fly(tmp_path, duration=25.0, overrides=[faults])
    assert flight.outcome.kind == "ended in failsafe"
    assert "no position: descends level and lands at 5." in str(flight.outcome)
    height = flight.truth.position[:, 2]
    assert flight.outcome.touchdown == pytest.approx(0.8, abs=0.2)
    assert flight.outcome.commanded is None  # the trajectory does not command this descent
    assert height[(flight.truth.times > 4.0) & (flight.truth.times < 6.0)].min() > 1.5
    assert abs(flight.truth.position[:, :2]).max() < 2.0


def test_stall_ends_run_and_is_reported(tmp_path):
    def answer(n, reply):
        return [reply] if n < 800 else []

    with pytest.raises(FirmwareError, match=r"betaflight: no motor outputs for 1 s at t = [\d.]+ s; the firmware has"):
        fly(tmp_path, answer, step_timeout=1.0)
    flight = Flight.read(tmp_path / "flight.mcap")
    assert len(flight.truth) > 10
    assert "no motor outputs" in flight.metadata["failure"]


def test_absent_firmware_is_reported(tmp_path):
    first = free_ports()
    with pytest.raises(FirmwareError, match=rf"no answer at 127.0.0.1:{first + 3} after 0.3 s; start betaflight"):
        fly_single(config(first, start_timeout=0.3), tmp_path / "flight.mcap")


def test_arming_blockers_are_reported(tmp_path):
    with pytest.raises(FirmwareError, match=r"cannot be armed after 2 s \(calibrating, accelerometer not calibrated\)"):
        fly(tmp_path, blockers=1 << 12 | 1 << 23, start_timeout=2.0)


def test_used_port_is_reported(tmp_path):
    import socket

    first = free_ports()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", first))
        with pytest.raises(FirmwareError, match=rf"cannot listen on udp 127.0.0.1:{first} .*stop the other"):
            fly_single(config(first), tmp_path / "flight.mcap")


def test_other_betaflight_is_reported(tmp_path):
    first = free_ports()
    with Peer(first), pytest.raises(FirmwareError, match=r"cannot listen on udp 127.0.0.1:.*stop the other"):
        fly_single(config(first, command='["true"]'), tmp_path / "flight.mcap")
