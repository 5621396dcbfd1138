"""Library that makes a firmware repeatable: equal answers of a threaded program under load, and its limits."""

import functools
import hashlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from lapwing.cosim.processes.patience import Patience
from lapwing.cosim.processes.shared_core import bind, cores_at_start
from lapwing.services.common.firmware import repeatable
from lapwing.services.common.firmware.repeatable import Repeatable, Turns, library

HOST, STEP, IDLE = "127.0.0.1", 2_000_000, b"idle"
PATIENT = 300.0  # [s] for a busy machine
SOURCE = Path(__file__).with_name("threaded_firmware.c")
KINDS = {"bind": "b", "send": "s", "connect": "c"}

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not shutil.which("cc"), reason="needs Linux and a C compiler (cc)"
)


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """Return the compiled program."""
    result = tmp_path_factory.mktemp("threaded") / "firmware"
    subprocess.run(["cc", "-O1", "-w", "-pthread", "-o", result, SOURCE], check=True)
    return result


@pytest.fixture
def load():
    """Keep the machine busy."""
    spin = [sys.executable, "-c", "import os\nwhile os.getppid() == int(__import__('sys').argv[1]): pass"]
    with ExitStack() as stack:
        for _ in range(2):
            process = stack.enter_context(subprocess.Popen([*spin, str(os.getpid())]))
            stack.callback(process.kill)
        yield


class Simulator:
    """Lapwing's end of the link to a program of a kind."""

    def __init__(self, stack, program, kind, folder, seed=0, ordered=True, extra=()):
        self.kind = kind
        self.socket = stack.enter_context(
            socket.socket(type=socket.SOCK_STREAM if kind == "connect" else socket.SOCK_DGRAM)
        )
        self.socket.bind((HOST, 0))
        own = self.socket.getsockname()[1]
        with socket.socket(type=socket.SOCK_DGRAM) as free:
            free.bind((HOST, 0))
            state = free.getsockname()[1]
        arguments = {"bind": (state, own), "send": (own,), "connect": (own, folder / f"commands{own}")}[kind]
        turns = Turns(KINDS[kind], int(arguments[0]), STEP, (), IDLE)
        if kind == "bind":
            turns = turns._replace(answer_port=own, start_ns=5 * STEP, read_ns=100)
        self.library = Repeatable(library(), turns, seed) if ordered else None
        environment = {**os.environ, **(self.library.environment if ordered else {})}
        if kind == "connect":
            self.socket.listen()
        self.process = subprocess.Popen(
            [program, kind, *map(str, (*arguments, *extra))], env=environment, start_new_session=True,
            pass_fds=(self.library.child.fileno(),) if ordered else (), stdout=subprocess.PIPE,
            preexec_fn=functools.partial(bind, 0, cores_at_start(ordered)),
        )  # fmt: skip
        stack.callback(self.process.stdout.close)
        stack.callback(self.process.wait)
        stack.callback(os.killpg, self.process.pid, signal.SIGKILL)  # also the clients of its start script
        self.peer = (HOST, state)
        self.socket.settimeout(PATIENT)
        if kind == "connect":
            self.socket = stack.enter_context(self.socket.accept()[0])
        if kind == "bind" and ordered:
            self.wait("ready")
        if kind == "send":
            _, self.peer = self.socket.recvfrom(8)
        self.socket.settimeout(PATIENT if ordered else 0.05)

    def wait(self, event):
        patience = Patience(PATIENT)
        while not getattr(self.library, event) and not patience.over:
            self.library.read()
        return getattr(self.library, event)

    def step(self, number):
        """Return the answer to a message; without the library, it may be missing."""
        data = number.to_bytes(8, "little")
        self.socket.sendto(data, self.peer) if self.kind != "connect" else self.socket.sendall(data)
        result = b""
        try:
            while not result or (self.kind == "connect" and self.library and not result.endswith(IDLE)):
                result += self.socket.recv(64)
        except TimeoutError:
            if self.library:
                raise
            return b"none"
        return result


def digest(program, kind, folder, steps=60, **options):
    with ExitStack() as stack:
        simulator = Simulator(stack, program, kind, folder, **options)
        result = hashlib.sha1()
        for number in range(steps):
            result.update(simulator.step(number))
        if simulator.library:
            assert simulator.library.problem == ""
        return result.hexdigest()


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_answers_are_equal_under_load(program, kind, tmp_path, load):
    assert len({digest(program, kind, tmp_path) for _ in range(20)}) == 1


@pytest.mark.nightly  # by chance, two runs without the library may be equal
@pytest.mark.parametrize("kind", KINDS)
def test_answers_differ_without_library(program, kind, tmp_path, load):
    assert len({digest(program, kind, tmp_path, ordered=False) for _ in range(3)}) > 1


def test_commands_of_start_script_may_come_together(program, tmp_path):
    """Commands of PX4's `ekf2 start &` and the next line. While the script runs, all answers are idle."""
    with ExitStack() as stack:
        simulator = Simulator(stack, program, "connect", tmp_path, extra=("together",))
        assert any(simulator.step(number) != IDLE for number in range(200))


def test_seed_varies_order_of_threads(program, tmp_path):
    digests = [digest(program, "send", tmp_path, seed=seed) for seed in (0, 1, 1, 2)]
    assert digests[1] == digests[2]
    assert len(set(digests)) == 3


def test_clock_follows_real_time_once_the_link_is_closed(program, tmp_path):
    with ExitStack() as stack:
        simulator = Simulator(stack, program, "send", tmp_path, extra=("alone",))
        simulator.step(0)
        simulator.library.close()
        start = time.monotonic()
        os.read(simulator.process.stdout.fileno(), 1)
        for _ in range(5):  # its wait for a message ends after 0.1 s
            os.read(simulator.process.stdout.fileno(), 1)
        assert time.monotonic() - start > 0.5


@pytest.mark.long
def test_spinning_thread_is_named(program, tmp_path):
    with ExitStack() as stack:
        simulator = Simulator(stack, program, "send", tmp_path, extra=("spin",))
        for number in range(49):
            simulator.step(number)
        simulator.socket.settimeout(1.0)
        with pytest.raises(TimeoutError):
            simulator.step(49)
        assert "spins: 5 s of CPU time" in simulator.wait("stuck")


def test_foreign_calls_and_traffic_are_named(program, tmp_path):
    with socket.socket(type=socket.SOCK_DGRAM) as free:
        free.bind((HOST, 0))
        port = free.getsockname()[1]
    with ExitStack() as stack:
        simulator = Simulator(stack, program, "send", tmp_path, extra=("barrier",))
        for number in range(100):
            simulator.step(number)
        assert simulator.library.problem == "it calls pthread_barrier_wait, which cannot be ordered"
    with ExitStack() as stack, socket.socket(type=socket.SOCK_DGRAM) as station:
        simulator = Simulator(stack, program, "bind", tmp_path, extra=("foreign", port))
        station.sendto(b"hello", (HOST, port))
        for number in range(10):
            simulator.step(number)
        expected = f"it gets messages by port {station.getsockname()[1]}, as from a ground station"
        assert simulator.library.problem == expected


def test_program_that_does_not_load_library_is_named(program, tmp_path):
    static = tmp_path / "static"
    done = subprocess.run(["cc", "-static", "-w", "-pthread", "-o", static, SOURCE], check=False, capture_output=True)
    if done.returncode:
        pytest.skip("no static C library")
    with ExitStack() as stack:
        simulator = Simulator(stack, static, "send", tmp_path)
        assert simulator.step(0)
        assert simulator.library.problem == repeatable.NOT_LOADED


def test_missing_compiler_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(repeatable.cache_files, "root", lambda: tmp_path)
    monkeypatch.setattr(repeatable, "compilers", list)
    with pytest.raises(OSError, match="no C compiler; install gcc, or pip install ziglang"):
        library()
    monkeypatch.setattr(repeatable, "compilers", lambda: [["false"]])
    with pytest.raises(OSError, match="false fails: no message"):
        library()
    assert not list(tmp_path.glob("firmware/*"))
