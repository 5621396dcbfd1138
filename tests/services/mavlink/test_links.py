"""Links: frames in pieces over TCP and a serial line, rate limit, jitter, watch of sockets."""

import os
import pty
import queue
import selectors
import socket
import time

import pytest
from fake_vehicle import flying, free_port, until

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.link_server import Pacing
from lapwing.services.mavlink.links.link import Budget
from lapwing.services.mavlink.service import SocketWatch


def frame():
    return mavlink.MAVLink_param_request_read_message(1, 1, b"MPC_XY_P", -1).pack(mavlink.MAVLink(None, 255, 190))


def receives(read):
    codec, result = mavlink.MAVLink(None), []
    codec.robust_parsing = True

    def poll():
        result.extend(m.get_type() for m in codec.parse_buffer(read()) or ())
        return "PARAM_VALUE" in result

    return until(poll)


def test_tcp_frames_in_pieces_and_disconnect():
    port = free_port(socket.SOCK_STREAM)
    with flying(f"tcpin:127.0.0.1:{port}") as running:
        with socket.create_connection(("127.0.0.1", port)) as client:
            for byte in frame():
                client.sendall(bytes([byte]))
                time.sleep(0.001)
            assert receives(lambda: client.recv(4096))
        assert until(lambda: not running.hub.adapter.sessions)


def test_serial_line_gets_telemetry_but_commands_are_rejected():
    master, slave = pty.openpty()
    with flying(f"serial:{os.ttyname(slave)}:57600") as running:
        os.write(master, frame())
        assert receives(lambda: os.read(master, 4096))
        os.write(master, mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(mavlink.MAVLink(None, 255, 190)))
        arm = mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1.0, *(0.0,) * 6).pack(mavlink.MAVLink(None, 255, 190))
        os.write(master, arm)
        assert until(lambda: running.counts["command from another machine"])
        assert not running.vehicle.armed
    os.close(master)
    os.close(slave)


def test_used_port_is_reported():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        url = f"tcpin:127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(ValueError, match=f"--mavlink {url}: address already in use"), flying(url):
            pass


def test_budget_allows_one_second_of_messages():
    budget = Budget(100.0)
    assert 100 <= sum(budget.take() for _ in range(1000)) < 200


def test_jitter_and_lag_of_telemetry_steps():
    pacing = Pacing(2.0)
    for simulated, wall in ((0.0, 10.0), (0.02, 10.01), (0.04, 10.025), (0.06, 10.03)):
        pacing.note(simulated, wall)
    assert pacing.jitter() == pytest.approx([0.0, 0.005, 0.005])
    assert pacing.behind() == pytest.approx(0.005)
    assert "no real-time factor" in Pacing(None).report()


def test_watch_wakes_once_until_resumed():
    wakes = queue.SimpleQueue()
    near, far = socket.socketpair()
    with near, far, selectors.DefaultSelector() as selector:
        selector.register(near, selectors.EVENT_READ, lambda: near.recv(16))
        with SocketWatch(selector, lambda: wakes.put(None)) as watch:
            for _ in range(3):
                assert not watch.ready
                far.send(b"data")
                wakes.get(timeout=600.0)
                assert watch.ready
                assert wakes.empty()
                for key, _ in selector.select(0.0):
                    key.data()
                watch.resume()


def test_watch_ends_while_ready_socket_has_not_been_read():
    wakes = queue.SimpleQueue()
    near, far = socket.socketpair()
    with near, far, selectors.DefaultSelector() as selector:
        selector.register(near, selectors.EVENT_READ)
        with SocketWatch(selector, lambda: wakes.put(None)):
            far.send(b"data")
            wakes.get(timeout=600.0)
        with SocketWatch(selector, lambda: wakes.put(None)):
            pass
        assert selector.get_map().keys() == {near.fileno()}
