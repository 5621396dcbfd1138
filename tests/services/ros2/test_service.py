"""Run as a node of a ROS 2 graph, observed and commanded by zenoh-ros2-sdk, an independent client."""

import json
import os
import queue
import socket
import subprocess
import sys
import time

import numpy as np
import pytest

from lapwing import read_log
from lapwing.cosim.log import LogReader, LogWriter
from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.messages import (
    Actuators,
    Bool,
    Clock,
    Log,
    OperatorCommand,
    OperatorInput,
    PoseStamped,
    String,
    header,
    stamp,
)
from lapwing.messages.types import FOLDER
from lapwing.services.common.operator_inbox import AnsweredInbox
from lapwing.services.process_table import ROS2, required_processes
from lapwing.services.ros2.commands import SOURCE
from lapwing.services.ros2.node import ROUTER, Node, parse_router
from lapwing.services.scene_resolver import load, resolve
from tests.commands import run_command
from tests.endpoints import loopback_endpoints

pytestmark = pytest.mark.long

DOMAIN = 7
PATIENCE = 600.0  # [s] for the run to compile and start on a busy machine


@pytest.fixture
def port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


@pytest.fixture
def diagram(port, tmp_path):
    """Return publishers and subscribers of another program on a router; the first opens its session."""
    pytest.importorskip("zenoh_ros2_sdk", reason="needs the extra `clients`")
    from zenoh_ros2_sdk import message_registry
    from zenoh_ros2_sdk.session import ZenohSession

    for path in FOLDER.glob("*/*.msg"):  # so that no definition is downloaded
        copy = tmp_path / "msg" / path.parent.name / "msg" / path.name
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(path.read_text())
    message_registry.get_registry().messages_dir = tmp_path / "msg"
    diagram = Graph(port)
    yield diagram
    for entity in diagram.entities:
        entity.close()
    if ZenohSession._instance is not None:
        ZenohSession._instance.session.close()
        ZenohSession._instance = None
    message_registry._registry = None


class Graph:
    """View of the other program on the ROS 2 graph."""

    def __init__(self, port):
        self._where = {"domain_id": DOMAIN, "router_ip": "127.0.0.1", "router_port": port}
        self.entities = []

    def topics(self):
        """Return the types by topic."""
        from zenoh_ros2_sdk import discovery

        return dict(discovery.get_topic_names_and_types(**self._where))

    def publisher(self, topic, message):
        from zenoh_ros2_sdk import ROS2Publisher

        result = ROS2Publisher(topic, message.type_name, **self._where)
        self.entities.append(result)
        return result

    def subscribe(self, topic, message):
        """Return a queue of the received messages."""
        from zenoh_ros2_sdk import ROS2Subscriber

        arrived = queue.SimpleQueue()
        self.entities.append(ROS2Subscriber(topic, message.type_name, callback=arrived.put, **self._where))
        return arrived

    def type_(self, name):
        """Return the other program's class of a message."""
        from zenoh_ros2_sdk.session import ZenohSession

        return ZenohSession.get_instance().store.types[name]


def fly(tmp_path, port, *more, scene="groundstation", domain=DOMAIN):
    words = ["--ros2", str(domain), "--ros2-router", f"127.0.0.1:{port}", "--log", str(tmp_path / "a.mcap"), *more]
    command = [sys.executable, "-m", "lapwing", "run", scene, "--set", "success.require=[]", *words]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    await_listener(run, port)
    return run


def await_listener(process, port):
    deadline = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < deadline:
        try:
            return socket.create_connection(("127.0.0.1", port)).close()
        except ConnectionRefusedError:
            time.sleep(0.1)
    process.kill()
    raise AssertionError(process.communicate()[0])


def plain(message):
    """Return a message of either program as numbers and texts."""
    if hasattr(message, "_fields"):
        return {name: plain(getattr(message, name)) for name in message._fields}
    if hasattr(message, "__msgtype__"):
        return {name: plain(value) for name, value in vars(message).items() if name != "__msgtype__"}
    return message


def test_ros_nodes_observe_and_command_run(tmp_path, port, diagram):
    run = fly(tmp_path, port, "--speed", "2", "--set", "run.duration=14")
    try:
        clock, poses = diagram.subscribe("/clock", Clock), diagram.subscribe("/drone1/pose", PoseStamped)
        arm, mode = diagram.publisher("/drone1/command/arm", Bool), diagram.publisher("/drone1/command/mode", String)
        target = diagram.publisher("/drone1/command/pose", PoseStamped)
        events = diagram.subscribe("/drone1/events", Log)
        received = [poses.get(timeout=PATIENCE)]
        topics = diagram.topics()
        there = received[0].pose.__class__(
            diagram.type_("geometry_msgs/msg/Point")(2.0, 1.0, 3.0), received[0].pose.orientation
        )
        started = False
        while received[-1].header.stamp.sec < 13:
            received.append(poses.get(timeout=PATIENCE))
            if received[-1].header.stamp.sec >= 6:  # the estimator has settled
                if poses.empty():  # one command at a time, not one for every queued message
                    target.publish(header=received[-1].header, pose=there)
                if not started and received[-1].header.stamp.nanosec > 500_000_000:
                    started = True
                    mode.publish(data="offboard")
                    arm.publish(data=True)
        output = run.communicate(timeout=PATIENCE)[0]
    finally:
        run.kill()
    assert run.returncode == 0, output
    assert "commands accepted\n" in output
    with LogReader(tmp_path / "a.mcap") as log:
        types = {topic: [kind] for topic, kind in log.topics().items()}
        recorded = [PoseStamped.decode(payload) for *_, payload in log.messages(["/drone1/pose"])]
        inputs = [OperatorInput.decode(payload) for *_, payload in log.messages(["/drone1/vehicle_command"])]
    types.pop("/wall_time")  # published by the recorder
    assert types.items() <= topics.items()
    place = recorded.index(next(m for m in recorded if plain(m) == plain(received[0])))
    assert [plain(m) for m in received] == [plain(m) for m in recorded[place : place + len(received)]]
    assert clock.qsize() >= len(received) - 1
    reported = [events.get_nowait() for _ in range(events.qsize())]
    assert ("arming", "armed") in {(event.name, event.msg) for event in reported}
    commands = [command for message in inputs for command in message.commands]
    assert {c.source for c in commands} == {SOURCE}
    assert [c.kind for c in commands if c.kind != "offboard_position"] == ["offboard", "arm"]
    position = recorded[-1].pose.position
    assert abs(position.x - 2.0) < 0.5
    assert abs(position.y - 1.0) < 0.5
    assert abs(position.z - 3.0) < 0.5


def test_node_drives_motors(tmp_path, port, diagram):
    run = fly(tmp_path, port, "--speed", "1", "--set", "run.duration=12", "--set", "autopilot.estimator=ground_truth")
    try:
        poses = diagram.subscribe("/drone1/pose", PoseStamped)
        arm, mode = diagram.publisher("/drone1/command/arm", Bool), diagram.publisher("/drone1/command/mode", String)
        motors = diagram.publisher("/drone1/command/motors", Actuators)
        volts, second = np.array([1.0, 1.5, 2.0, 2.5]), 0
        while (pose := poses.get(timeout=PATIENCE)).header.stamp.sec < 11:
            none = diagram.type_("geometry_msgs/msg/Vector3")(0.0, 0.0, 0.0)
            motors.publish(header=pose.header, motor_voltage=volts, armed=False, thrust=volts, attitude_reference=none)
            if pose.header.stamp.sec > second:  # repeated, since the node may start late
                second = pose.header.stamp.sec
                mode.publish(data="offboard")
                arm.publish(data=True)
        output = run.communicate(timeout=PATIENCE)[0]
    finally:
        run.kill()
    assert run.returncode == 0, output
    with LogReader(tmp_path / "a.mcap") as log:
        _, recorded = log.history("/drone1/actuators")
        inputs = [OperatorInput.decode(payload) for *_, payload in log.messages(["/drone1/vehicle_command"])]
    values = [command for message in inputs for command in message.commands if command.kind == "offboard_motors"]
    assert {(command.source, command.values) for command in values} == {(SOURCE, tuple(volts))}
    assert np.all(recorded["motor_voltage"] == volts, axis=1).any()


NODE = """
import runpy, sys
from zenoh_ros2_sdk import message_registry
message_registry.get_registry(sys.argv[1])
sys.argv[1:] = sys.argv[2:]
runpy.run_path("examples/ros2_node.py")
"""


def test_node_in_lock_step_flies_the_same_at_any_speed(tmp_path, port, diagram):
    digests = []
    for delay in (0.0, 0.02):
        words = ["--set", "ros2.lock_step=true", "--set", "autopilot.estimator=ground_truth"]
        words += ["--set", "run.duration=6", "--speed", "max", "--json", str(tmp_path / "a.json")]
        run = fly(tmp_path, port, *words, domain=0)
        arguments = [tmp_path / "msg", delay, port]
        node = subprocess.Popen([sys.executable, "-c", NODE, *map(str, arguments)], stdout=subprocess.PIPE, text=True)
        try:
            output = run.communicate(timeout=PATIENCE)[0]
            answers = node.communicate(timeout=PATIENCE)[0]
        finally:
            run.kill()
            node.kill()
        assert (run.returncode, node.returncode) == (0, 0), output + answers
        assert "single-process" not in output  # a mode without nodes
        digests.append(json.loads((tmp_path / "a.json").read_text())["digest"])
    assert digests[0] == digests[1]
    flight = read_log(tmp_path / "a.mcap")
    assert flight.truth.position[-1, 2] > 1.0
    again = [sys.executable, "-m", "lapwing", "resimulate", str(tmp_path / "a.mcap")]
    done = subprocess.run(again, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_run_in_lock_step_says_for_which_node_it_waits(tmp_path, port):
    run = fly(tmp_path, port, "--set", "ros2.lock_step=true", "--speed", "max")
    try:
        lines = iter(run.stdout.readline, "")
        assert "waiting for a ROS 2 node that publishes commands, for example /drone1/command/arm\n" in lines
    finally:
        run.terminate()
        run.communicate(timeout=PATIENCE)


def test_run_in_lock_step_says_for_which_node_it_waits_in_flight(tmp_path, port, diagram):
    words = ["--set", "ros2.lock_step=true", "--set", "autopilot.estimator=ground_truth", "--set", "run.duration=900"]
    run = fly(tmp_path, port, *words, "--speed", "4", domain=0)
    node = subprocess.Popen([sys.executable, "-c", NODE, *map(str, (tmp_path / "msg", 0.0, port))])
    try:
        lines = iter(run.stdout.readline, "")
        assert any(line.startswith("t = ") for line in lines)
        node.kill()
        assert any(line.startswith("waiting for the command of a ROS 2 node for drone1 with stamp ") for line in lines)
    finally:
        run.kill()
        node.kill()
        run.communicate()


def test_lock_step_without_commanded_vehicle_is_rejected(tmp_path, port):
    done = run_command("run", "hover", "--ros2", "0", "--ros2-router", f"127.0.0.1:{port}", "--speed", "max",
                       "--set", "ros2.lock_step=true", "--log", tmp_path / "a.mcap", code=2)  # fmt: skip
    expected = "ros2.lock_step: no vehicle accepts commands; expected autopilot.accept_commands = true\n"
    assert done.stderr.endswith(expected)


def test_commands_of_a_tick_do_not_depend_on_the_order_of_arrival():
    def answer(tick, *kinds):
        commands = tuple(OperatorCommand(kind) for kind in kinds)
        return tick * 1000, OperatorInput(header(0, "drone1"), commands).encode()

    without_stamp = answer(0, "arm")
    sent = iter([answer(0, "a"), without_stamp, answer(5), answer(10, "b"), answer(15, "c")])
    inbox = AnsweredInbox(["drone1"], lambda waiting_for: next(sent), 1000, 5)
    taken = {tick: [command.kind for command in inbox.take("drone1", tick)] for tick in range(0, 21, 5)}
    assert taken == {0: [], 5: ["a"], 10: ["arm"], 15: ["b"], 20: ["c"]}


@pytest.mark.nightly
def test_ros_nodes_observe_fleet_and_command_one_vehicle(tmp_path, port, diagram):
    more = ["--speed", "1", "--set", "run.duration=8", "--set", "autopilot.accept_commands=true"]
    run = fly(tmp_path, port, *more, scene="fleet")
    try:
        clock, events = diagram.subscribe("/clock", Clock), diagram.subscribe("/right/events", Log)
        arm, mode = diagram.publisher("/right/command/arm", Bool), diagram.publisher("/right/command/mode", String)
        topics, requested = {}, False
        while (now := clock.get(timeout=PATIENCE).clock).sec < 3:
            topics = topics or diagram.topics()
            if not requested and now.sec >= 1:
                requested = True
                mode.publish(data="hold")
                arm.publish(data=True)
        output = run.communicate(timeout=PATIENCE)[0]
    finally:
        run.kill()
    assert run.returncode == 0, output
    assert "ros2: right: 2 commands accepted\n" in output
    with LogReader(tmp_path / "a.mcap") as log:
        types = {topic: [kind] for topic, kind in log.topics().items()}
        inputs = {
            name: [OperatorInput.decode(payload) for *_, payload in log.messages([f"/{name}/vehicle_command"])]
            for name in ("left", "right", "scout")
        }
    types.pop("/wall_time")
    assert types.items() <= topics.items()
    commands = {name: [c.kind for message in reported for c in message.commands] for name, reported in inputs.items()}
    assert commands == {"left": [], "right": ["hold", "arm"], "scout": []}
    assert ("mode", "hold") in {(e.name, e.msg) for e in (events.get_nowait() for _ in range(events.qsize()))}


@pytest.mark.nightly
def test_ros_nodes_observe_distributed_run(tmp_path, port, diagram):
    sets = [
        "--set",
        "run.duration=8",
        "--set",
        "autopilot.accept_commands=true",
        "--set",
        "autopilot.estimator=ground_truth",
    ]
    names = [*required_processes(resolve(load("groundstation", sets[1::2]))), ROS2]
    table = ",".join(f"{name}={at}" for name, at in loopback_endpoints([*names, MONITOR]).items())
    common = ["groundstation", *sets, "--set", "success.require=[]", "--endpoints", table, "--key-prefix", "elsewhere"]
    log = ["--log", str(tmp_path / "a.mcap")]
    graph_at = ["--ros2", str(DOMAIN), "--ros2-router", f"127.0.0.1:{port}"]
    options = {"plant": ["--speed", "1"], "recorder": log, ROS2: graph_at}
    lapwing, pipe = [sys.executable, "-m", "lapwing"], subprocess.PIPE
    started = []

    def start(*words):
        command = [*lapwing, *words, *common, "--insecure"]
        started.append(subprocess.Popen(command, stdout=pipe, stderr=subprocess.STDOUT, text=True))
        return started[-1]

    try:
        node = start("service", ROS2, *options[ROS2])
        await_listener(node, port)
        for name in names[:-1]:
            start("service", name, *options.get(name, []))
        run = start("run", *log)
        clock, events = diagram.subscribe("/clock", Clock), diagram.subscribe("/drone1/events", Log)
        arm, requested = diagram.publisher("/drone1/command/arm", Bool), False
        while clock.get(timeout=PATIENCE).clock.sec < 3:
            if not requested:
                requested = True
                arm.publish(data=True)
        output, reported = run.communicate(timeout=PATIENCE)[0], node.communicate(timeout=PATIENCE)[0]
    finally:
        for process in started:
            process.kill()
            process.communicate()
    assert (run.returncode, node.returncode) == (0, 0), output
    assert "1 commands accepted\n" in reported
    with LogReader(tmp_path / "a.mcap") as log:
        inputs = [OperatorInput.decode(payload) for *_, payload in log.messages(["/drone1/vehicle_command"])]
    assert [(c.source, c.kind) for message in inputs for c in message.commands] == [(SOURCE, "arm")]
    assert ("arming", "armed") in {(e.name, e.msg) for e in (events.get_nowait() for _ in range(events.qsize()))}


def test_second_node_joins_router_of_first(port):
    with Node(DOMAIN, f"127.0.0.1:{port}") as first, Node(DOMAIN, f"127.0.0.1:{port}") as second:
        requested = second.subscribe({"/clock": Clock})
        first.declare("/clock", Clock.type_name)
        first.declare("/foreign", "not/msg/Ours")
        first.put("/foreign", 0, b"")
        sent = Clock(stamp(5)).encode()
        deadline, result = time.monotonic() + PATIENCE, None
        while result is None and time.monotonic() < deadline:  # the subscription may be discovered late
            first.put("/clock", 5, sent)
            result = requested.get()
    assert result == ("/clock", sent)


def test_replay_appears_in_ros_graph(tmp_path, port):
    log, sent = tmp_path / "flight.mcap", [Clock(stamp(k)).encode() for k in range(200)]
    with LogWriter(log, {}, {}) as writer:
        for k, payload in enumerate(sent):
            writer.write("/clock", Clock, payload, k * 4_000_000)
    router, (endpoint,) = f"127.0.0.1:{port}", loopback_endpoints(["a"]).values()
    words = ["replay", log, "--loop", "--listen", endpoint, "--key-prefix", "test-ros2-replay", "--insecure"]
    words += ["--ros2", DOMAIN, "--ros2-router", router]
    with Node(DOMAIN, router) as reader:
        arrived, result = reader.subscribe({"/clock": Clock}), None
        with subprocess.Popen([sys.executable, "-m", "lapwing", *map(str, words)]) as player:
            deadline = time.monotonic() + PATIENCE
            while result is None and player.poll() is None and time.monotonic() < deadline:
                time.sleep(0.05)
                result = arrived.get()
            player.terminate()
    assert result is not None
    assert result[0] == "/clock"
    assert result[1] in sent


@pytest.mark.long
def test_replay_joins_ros_graph_with_default_endpoints(tmp_path):
    for number in (7447, 7448):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", number)) == 0:
                pytest.skip(f"another program listens at port {number}")
    log = tmp_path / "flight.mcap"
    with LogWriter(log, {}, {}) as writer:
        for k in range(5):
            writer.write("/clock", Clock, Clock(stamp(k)).encode(), k * 4_000_000)
    words = [sys.executable, "-m", "lapwing", "replay", str(log), "--speed", "max", "--ros2", str(DOMAIN)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "5 messages published" in done.stdout


def test_missing_router_is_reported(port):
    with (
        socket.create_server(("127.0.0.1", port)),
        pytest.raises(ValueError, match=f"--ros2: cannot connect to tcp/127.0.0.1:{port}: .* expected a Zenoh router"),
    ):
        Node(DOMAIN, f"127.0.0.1:{port}")


@pytest.mark.parametrize("text", ["", "7447", "localhost", "localhost:x", "localhost:99999", "a b:1"])
def test_invalid_router_address_is_rejected(text):
    with pytest.raises(ValueError, match=f"expected HOST:PORT, for example {ROUTER}"):
        parse_router(text, False)


def test_remote_address_needs_insecure():
    assert parse_router("[::1]:7447", False) == ("tcp/[::1]:7447", True)
    assert parse_router("robot:7447", True) == ("tcp/robot:7447", False)
    with pytest.raises(ValueError, match="robot:7447: programs of that host could send commands"):
        parse_router("robot:7447", False)


SIMULATION_TIME = """
import rclpy
from rclpy.parameter import Parameter

rclpy.init()
node = rclpy.create_node("probe", parameter_overrides=[Parameter("use_sim_time", value=True)])
while not (now := node.get_clock().now().nanoseconds):
    rclpy.spin_once(node, timeout_sec=1.0)
print(now)
"""


@pytest.mark.skipif(os.environ.get("LAPWING_ROS2") != "1", reason="needs ROS 2 with rmw_zenoh, and LAPWING_ROS2=1")
def test_ros2_installation_observes_and_commands_run(tmp_path, port):
    nodes = {"RMW_IMPLEMENTATION": "rmw_zenoh_cpp", "ROS_DOMAIN_ID": str(DOMAIN), "PYTHONUNBUFFERED": "1"}
    nodes["ZENOH_CONFIG_OVERRIDE"] = f'connect/endpoints=["tcp/127.0.0.1:{port}"]'
    environment = os.environ | nodes

    def output_of(*command):
        return subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, timeout=PATIENCE).stdout

    def publish(topic, kind, value):
        output_of("ros2", "topic", "pub", "--once", "-w", "1", f"/drone1/command/{topic}", kind, value)

    target = None
    run = fly(tmp_path, port, "--speed", "1", "--set", "run.duration=90")
    try:
        listed = output_of("ros2", "topic", "list", "--no-daemon").split()
        assert {"/clock", "/drone1/imu", "/drone1/command/arm"} <= set(listed)
        pose = ("/drone1/pose", "geometry_msgs/msg/PoseStamped")
        assert "frame_id: world" in output_of("ros2", "topic", "echo", "--no-daemon", "--once", *pose)
        assert "average rate: " in output_of("timeout", "--signal=INT", "8", "ros2", "topic", "hz", pose[0])
        assert 0 < int(output_of("/usr/bin/python3", "-c", SIMULATION_TIME)) < 90e9
        there = "{pose: {position: {x: 2.0, y: 1.0, z: 3.0}, orientation: {w: 1.0}}}"
        command = ["ros2", "topic", "pub", "-r", "20", "/drone1/command/pose", pose[1], there]
        target = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
        time.sleep(5.0)  # the mode is accepted only while setpoints arrive
        publish("mode", "std_msgs/msg/String", "{data: offboard}")
        publish("arm", "std_msgs/msg/Bool", "{data: true}")
        output = run.communicate(timeout=PATIENCE)[0]
    finally:
        run.kill()
        if target:
            target.kill()
    assert run.returncode == 0, output
    assert "commands accepted\n" in output
    with LogReader(tmp_path / "a.mcap") as log:
        _, flights = log.history("/drone1/pose")
        inputs = [OperatorInput.decode(payload) for *_, payload in log.messages(["/drone1/vehicle_command"])]
    kinds = [command.kind for message in inputs for command in message.commands]
    assert [kind for kind in kinds if kind != "offboard_position"] == ["offboard", "arm"]
    assert flights["pose.position"][-1] == pytest.approx([2.0, 1.0, 3.0], abs=0.5)
