"""Configurations of firmware links for tests with scripted peers."""

import ctypes
import json
import os
import socket
import sys
import threading
from contextlib import ExitStack, suppress
from pathlib import Path

from lapwing.cosim.diagram.compiled_block import CONTINUE, bind
from lapwing.cosim.diagram.tick_schedule import LATCHED, Port
from lapwing.kernels.row_packing import pack_row
from lapwing.services.common.firmware.block import FirmwareBlock
from lapwing.services.common.firmware.firmware_config import FirmwareConfig
from lapwing.services.common.firmware.hold import COMMAND, FirmwareCommand
from lapwing.services.common.firmware.link import FirmwareOutput
from tests.commands import run_command

HOST = "127.0.0.1"


UDP, TCP = socket.SOCK_DGRAM, socket.SOCK_STREAM
PORTS = {"px4": ((TCP, 4560, 1), (UDP, 14540, 1)), "ardupilot": ((UDP, 9002, 10), (TCP, 5760, 10))}
"""Ports of Lapwing and the firmware: kind, number of instance 0, and distance between two instances."""


def free_instance(firmware):
    """Return an instance of a firmware whose ports are free."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
    for instance in range(30 + 10 * (worker % 7), 100):
        with ExitStack() as stack, suppress(OSError):
            for kind, default, stride in PORTS[firmware]:
                s = stack.enter_context(socket.socket(socket.AF_INET, kind))
                s.bind((HOST, default + stride * instance))
            return instance
    raise OSError("no free ports")


def lapwing(*arguments, code=0, **options):
    """Run a command. Return its result; check its exit code unless `code` is None."""
    done = run_command(*arguments, code=code, **options)
    assert "Traceback" not in done.stderr
    return done


def scripted(firmware, *options):
    """Return the command of the scripted program of a firmware."""
    return [sys.executable, str(Path(__file__).parent / f"{firmware}/scripted_{firmware}.py"), *map(str, options)]


def program(command):
    """Return the option that starts a program."""
    return "--set", f"autopilot.command={json.dumps(list(map(str, command)))}"


def fly(firmware, command, *options, code=0):
    """Run the scene of a firmware with a program, on a free instance."""
    instance = "--set", f"autopilot.instance={free_instance(firmware)}"
    scene = "run", f"{firmware}_quad", "--mode", "single-process"
    return lapwing(*scene, *program(command), *instance, *options, code=code)


def link_with(kind, own, samples):
    """Return a link of a class on a free instance, not yet opened, with its compiled exchange `steps`."""
    firmware = own.__class__.__module__.split(".")[-2]
    link = kind(firmware_setup(firmware, own, free_instance(firmware)))
    link.steps = Exchange(link, samples)
    return link


def firmware_setup(firmware, own, instance, **changes):
    """Return the configuration of a link with steps of 4 ms that waits for a peer."""
    config = FirmwareConfig(
        firmware, [], None, {}, HOST, None, instance, 20.0, 5.0, True, 0, False, {}, "", False, (0, 2, 1, 3), 11.1,
        (0.0, 0.0, 0.11), 0.004, 4_000_000, 1, 25, (), (), own,
    )  # fmt: skip
    return config._replace(**changes)


class Background:
    """Function that runs in a thread; `join` raises its exception."""

    def __init__(self, function, *arguments):
        """Start the thread."""
        self.result = self.error = None

        def run():
            try:
                self.result = function(*arguments)
            except BaseException as error:
                self.error = error

        self._thread = threading.Thread(target=run, daemon=True)
        self._thread.start()

    def join(self, timeout=300.0):
        """Wait for the end of the function. Return its result."""
        self._thread.join(timeout)
        assert not self._thread.is_alive()
        if self.error:
            raise self.error
        return self.result


def never(_):
    """Do nothing: the run continues."""


class Exchange:
    """Compiled exchange of a link with fixed samples, with outputs in the firmware's order."""

    def __init__(self, link, samples):
        """Compile the exchange; a sample is the value of a port."""
        self.link, config = link, link._config
        self._rows = {port: pack_row(example)[None] for port, example in samples.items()}
        self._samples = dict(samples)
        rows = self._rows | {COMMAND: pack_row(FirmwareCommand((0.0,) * len(config.order)))[None]}
        ports = {port: Port(port, example, LATCHED) for port, example in samples.items()}
        self._block = FirmwareBlock("autopilot", config, (), lambda _: link)
        self._block._opened = True  # by the test
        self._block.bind(_Diagram(ports, rows, self._samples))
        self._command = rows[COMMAND]
        self._code = self._block._diagram.code
        self._advance = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64)(self._code.function)

    def step(self, tick, **samples):
        """Exchange at a tick; `samples` replace earlier ones. Return the outputs and the state."""
        for port, value in samples.items():
            self._rows[port][0], self._samples[port] = pack_row(value), value
        if self._advance(self._code.memory, tick) != CONTINUE:
            raise self._block.failure(tick)
        *duty, armed, landed, finished, text_id, _, _, _, _ = self._command[0]
        order = self.link._config.order
        outputs = tuple(duty[order.index(k)] for k in range(len(order)))
        text = self._block.status_texts.table[int(text_id)]
        return FirmwareOutput(outputs, bool(armed), bool(landed), bool(finished), text.mode, text.failsafe)


class _Diagram:
    """Diagram of one block with constant inputs."""

    def __init__(self, ports, rows, samples):
        self.ports, self._rows, self._samples = ports, rows, samples

    def ring(self, port):
        return self._rows[port]

    def latest(self, port, tick):
        return self._samples[port]

    def block(self, name):
        return name

    def prepare(self, block):
        self.code = bind(block, self.ports, self._rows)
        return self.code

    def replace(self, block, code):
        pass
