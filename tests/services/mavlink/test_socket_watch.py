"""Watch of sockets: one wake-up until `resume`."""

import queue
import selectors
import socket

from lapwing.services.mavlink.service import SocketWatch


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
