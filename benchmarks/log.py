"""Messages per second that the recorder writes without loss, on a fast disk and on a slow one.

    python -m benchmarks.log [--seconds S]

A process publishes log packets on the bus at a rate of messages per second of wall time; the recorder runs in a
separate process. The messages in the log are counted.
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from benchmarks._command import command_line
from lapwing.cosim.access.private_sockets import private_endpoints
from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.topic_encoder import RecordBatch
from lapwing.cosim.executors.log_backpressure import LogBackpressure
from lapwing.cosim.executors.participant import Participant
from lapwing.cosim.log import LogReader
from lapwing.cosim.log.mcap_writer import Container
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import BATCH_KEY
from lapwing.cosim.transport.packets import pack_log_packet
from lapwing.cosim.transport.session_settings import mesh
from lapwing.messages import Imu, Odometry, PoseStamped, VehicleState, header
from lapwing.messages.cdr_arrays import Record, stamp_columns
from lapwing.messages.topics import IMU, ODOM, POSE, TRUTH
from lapwing.services.recorder import service as recorder

SOURCE, RECORDER = "source", "recorder"
PARTICIPANTS = PublisherIds("bench-log")
MOTORS = dict.fromkeys(("rotor_speed", "motor_voltage", "motor_current", "motor_power"), (0.0,) * 4)
SAMPLES = {
    TRUTH: VehicleState(header(0, "world"), **MOTORS),
    IMU: Imu(header(0, "base_link")),
    ODOM: Odometry(header(0, "world")),
    POSE: PoseStamped(header(0, "world")),
}
# messages per second, speed of the disk [bytes/s]; 0: unlimited
ROWS = ((5_000, 0), (20_000, 0), (50_000, 0), (50_000, 4_000_000))


def setup(rate, seconds):
    ticks = rate // len(SAMPLES)
    services = {SOURCE: None}
    return RunConfig(
        "bench", "", 1, int(ticks * seconds), ticks, 10**9 // ticks, "gauss_seidel", "drone1", services, {}, {}
    )


def batch(options, first, stop):
    """Return a log packet of the ticks [first, stop) with random numbers, which compress like those of a flight."""
    ticks = np.arange(first, stop)
    noise = np.random.default_rng(first)
    pages = []
    for topic, sample in SAMPLES.items():
        record = Record.of(sample)
        columns = stamp_columns(ticks * options.interval_ns)
        for name in ("pose.position", "velocity", "acceleration", "rotor_speed", "linear_acceleration"):
            if record.dtype.names and name in record.dtype.names:
                columns[name] = noise.normal(size=(len(ticks), *record.dtype[name].shape))
        pages.append(RecordBatch(topic, ticks, record.encode(len(ticks), columns)))
    return pack_log_packet(pages, first, stop)


def publish(options, endpoints, seconds):
    """Publish ten times per second at the configured rate. Return the number of messages and the duration [s]."""
    listen, connect = mesh(SOURCE, endpoints)
    with ZenohBus(listen, connect, gid=PARTICIPANTS.gid(SOURCE)) as bus:
        process = Participant(SOURCE, options, bus, PARTICIPANTS, [SOURCE, RECORDER])
        backlog = LogBackpressure(process, RECORDER)
        put = bus.publisher(f"{PARTICIPANTS.key_prefix}/{BATCH_KEY}/{SOURCE}")
        process.join()
        step = -(-options.rate // 10)
        started, first, end = time.perf_counter(), 0, int(options.rate * seconds)
        while first < end:
            stop = min(first + step, end)
            for tick in range(first, stop):
                backlog.wait_for_log(tick)
            payload = batch(options, first, stop)
            time.sleep(max(0.0, started + stop / options.rate - time.perf_counter()))
            put(payload, (stop - 1) * options.interval_ns)
            first = stop
        elapsed = time.perf_counter() - started
        put(b"", end * options.interval_ns)
        process.leave(lambda: put(b"", end * options.interval_ns))
        return end * len(SAMPLES), elapsed


def record(options, endpoints, log, disk):
    """Run the recorder on a disk with a speed [bytes/s]."""
    if disk:
        write = Container._write

        def slow(container, data):
            time.sleep(len(data) / disk)
            write(container, data)

        Container._write = slow
    listen, connect = mesh(RECORDER, endpoints)
    with ZenohBus(listen, connect, gid=PARTICIPANTS.gid(RECORDER)) as bus:
        process = Participant(RECORDER, options, bus, PARTICIPANTS, [SOURCE, RECORDER])
        recorder.run(process, SimpleNamespace(log=log, mode="bench", external=None, sources=None))
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def measure(rate, disk, seconds, folder):
    log = Path(folder, "log.mcap")
    with private_endpoints([SOURCE, RECORDER]) as endpoints:
        arguments = f"setup({rate}, {seconds}), {endpoints!r}, {str(log)!r}, {disk}"
        code = f"from benchmarks.log import record, setup; record({arguments})"
        with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as child:
            sent, elapsed = publish(setup(rate, seconds), endpoints, seconds)
            memory = float(child.communicate()[0])
    with LogReader(log) as read:
        recorded = sum(1 for topic, *_ in read.messages() if topic != "/wall_time")
        waited = read.metadata.get("waited_for_disk", "")
    size = log.stat().st_size / 1e6
    at = f"disk of {disk / 1e6:g} MB/s" if disk else "this disk"
    waiting = f", the recorder waited {waited} for the disk" if waited else ""
    print(
        f"{rate} messages/s for {seconds:g} s, {at}: {sent} published in {elapsed:.1f} s, {recorded} recorded, "
        f"{sent - recorded} lost; {size:.0f} MB; the recorder's memory at most {memory:.0f} MB{waiting}",
        flush=True,
    )


def main(seconds: float = 10.0) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for rate, disk in ROWS:
            measure(rate, disk, seconds, folder)


if __name__ == "__main__":
    command_line(main)
