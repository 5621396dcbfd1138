"""Core that Lapwing shares with a firmware in lock step, observed by a scripted program in flight."""

import os
import sys

import pytest

from tests.services.firmware_links import lapwing, program, scripted

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        sys.platform != "linux" or len(os.sched_getaffinity(0)) < 2, reason="one core, or no affinity of threads"
    ),
]


def fly(tmp_path, *arguments):
    """Fly. Return the cores of the program, of Lapwing's main thread, and of its other threads."""
    file = tmp_path / "cores.txt"
    lapwing(*arguments, *program(scripted("px4", "--cores", file)))
    own, main, *others = file.read_text().split()
    return own, main, set(others)


@pytest.mark.nightly
def test_firmware_and_exchanging_thread_share_a_core(tmp_path):
    own, main, others = fly(tmp_path, "run", "px4_quad", "--mode", "single-process", "--log", tmp_path / "a.mcap")
    assert own == main
    assert int(main) in os.sched_getaffinity(0)
    assert others  # the log's thread, at least
    assert main not in others


def test_firmware_runs_on_core_of_services(tmp_path):
    own, main, _ = fly(tmp_path, "run", "px4_quad", "--mode", "multi-process", "--log", tmp_path / "a.mcap")
    assert own == main
    assert int(main) in os.sched_getaffinity(0)
