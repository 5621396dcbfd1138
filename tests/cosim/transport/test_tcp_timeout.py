"""The system closes connections to hosts that no longer acknowledge data."""

import os
import socket

from lapwing.cosim.transport.session_settings import limit_silence


def test_timeout_is_set_on_tcp_sockets_only(tmp_path):
    file = (tmp_path / "a").open("w")
    with socket.create_server(("127.0.0.1", 0)) as door, socket.create_connection(door.getsockname()) as client:
        server, _ = door.accept()
        before = sorted(os.listdir("/proc/self/fd"))
        limit_silence(1234)
        assert sorted(os.listdir("/proc/self/fd")) == before
        for end in (client, server):
            assert end.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 1234
        client.sendall(b"x")
        assert server.recv(1) == b"x"
        server.close()
    file.close()
