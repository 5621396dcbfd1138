"""Signals during the imports of the command: one line and an exit code, from its first statement on."""

import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from tests.participants import participants

STRIKE = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # whatever started the tests may have it ignored
struck = []
def strike(event, arguments):
    if event == "import" and arguments[0] == "MODULE" and not struck:
        struck.append(True)
        os.kill(os.getpid(), signal.NUMBER)
sys.addaudithook(strike)
sys.argv = ["lapwing", "--version"]
from lapwing.cli.entry_point import main
main()
"""


def run_with_signal(module, number, output=subprocess.PIPE):
    """Run the command, which receives a signal just before it imports `module`."""
    code = textwrap.dedent(STRIKE).replace("MODULE", module).replace("NUMBER", number.name)
    return subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=output, text=True, check=False)


@pytest.mark.parametrize(
    "module", ["lapwing.cosim.processes.interrupt", "lapwing.cli.main", "typer", "lapwing.cli.study_commands"]
)
def test_ctrl_c_at_import_has_line_and_exit_code(module):
    done = run_with_signal(module, signal.SIGINT)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "lapwing: ended by SIGINT\n")


def test_termination_at_import_has_line_and_exit_code():
    done = run_with_signal("typer", signal.SIGTERM)
    assert (done.returncode, done.stdout, done.stderr) == (143, "", "lapwing: ended by SIGTERM\n")


def test_exit_code_is_equal_with_closed_streams():
    with open("/dev/full", "w") as full:
        assert run_with_signal("typer", signal.SIGINT, full).returncode == 130


HALF_MADE = """
import os, signal
from lapwing.cli import entry_point

class Text:  # like llvmlite's OutputString, whose __del__ reads an attribute of __init__
    def __init__(self):
        os.kill(os.getpid(), signal.SIGINT)
        self.pointer = 0
    def __del__(self):
        print(self.pointer)

entry_point.prepare_streams = Text
entry_point.main()
"""


def test_object_of_interrupted_constructor_is_silent():
    done = subprocess.run([sys.executable, "-c", HALF_MADE], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "lapwing: ended by SIGINT\n")


IN_CLASS = """
import os, signal
from lapwing.cli import entry_point

class Name:
    def __set_name__(self, owner, name):  # Python 3.11 raises RuntimeError from its exceptions
        os.kill(os.getpid(), signal.SIGINT)

def define():
    class Table:
        name = Name()

entry_point.prepare_streams = define
entry_point.main()
"""


def test_interrupt_in_class_definition_has_line_and_exit_code():
    done = subprocess.run([sys.executable, "-c", IN_CLASS], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "lapwing: ended by SIGINT\n")


LOST = """
import ctypes, os, signal, sys
from lapwing.cli import entry_point, main

@ctypes.CFUNCTYPE(None)
def notify():  # called by the compiler's library, which loses exceptions
    os.kill(os.getpid(), signal.SIGTERM)

def compile(*arguments, **options):
    notify()
    raise ERROR("no compiled object yet")

main.app = compile
entry_point.main()
"""


@pytest.mark.parametrize("error", ["RuntimeError", "ValueError"])
def test_error_after_a_lost_interrupt_is_the_interrupt(error):
    code = LOST.replace("ERROR", error)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (143, "", "lapwing: ended by SIGTERM\n")


CAUGHT = """
import os, signal
from lapwing.cli import entry_point, main
from lapwing.cosim.processes.interrupt import Stop

def run(*arguments, **options):
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except BaseException:  # like modules of scipy and requests while they are imported
        pass
    with Stop() as stop:
        stop.check()

main.app = run
entry_point.main()
"""


def test_interrupt_that_a_library_catches_before_the_run_ends_it():
    done = subprocess.run([sys.executable, "-c", CAUGHT], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "lapwing: ended by SIGINT\n")


@pytest.mark.long
@pytest.mark.parametrize("mode", ["single-process", "multi-process"])
def test_ctrl_c_in_flight_has_equal_text_in_both_modes(tmp_path, mode):
    command = [sys.executable, "-m", "lapwing", "run", "hover", "--speed", "0.1", "--mode", mode]
    environment = os.environ | {"PYTHONPATH": str(Path.cwd())}
    flown = subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        while not (line := flown.stdout.readline()).startswith("t ="):
            assert line, flown.stderr.read()
        flown.send_signal(signal.SIGINT)
        out, err = flown.communicate(timeout=120)
    finally:
        flown.kill()
    assert (flown.returncode, err) == (130, "lapwing: ended by SIGINT\n")
    assert re.search(r"^Aborted at \d+\.\d\d s: the run was ended$", out, re.MULTILINE)


SCENE = "formation"  # its specification is larger than the buffer of a pipe


@pytest.mark.long
def test_process_stopped_before_its_specification_is_named(tmp_path):
    command = [sys.executable, "-m", "lapwing", "run", SCENE, "--log", str(tmp_path / "a.mcap")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as launcher:
        while "plant" not in (names := participants(launcher.pid)):
            assert launcher.poll() is None
            time.sleep(0.005)
        os.kill(names["plant"], signal.SIGSTOP)
        try:
            _, error = launcher.communicate(timeout=300.0)
        except subprocess.TimeoutExpired:
            os.kill(names["plant"], signal.SIGKILL)
            launcher.kill()
            raise
    assert launcher.returncode == 1
    assert error.startswith("lapwing: plant: stopped for 2.5 s, at t = 0.000 s")
