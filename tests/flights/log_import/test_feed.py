"""Sensors of a recorded flight played into scripted firmwares that return the recorded estimate, with a known bias."""

import re
import shlex

import pytest
from flight_writers import ned, write_bin, write_ulog_topics

from tests.services.firmware_links import lapwing, scripted


def write_ulog_with_two_imus(path, flight):
    """Write a ULog file whose `sensor_combined` is the second of two IMUs."""
    v = ned(flight)
    fields, code, makers = "uint32_t device_id;float x;float y;float z;", "I3f", {"gyro": "omega", "accel": "force"}
    topics = [
        (f"sensor_{kind}", number, fields, code, lambda k, n=number, name=name: (100 + n, *v[name][k]))
        for kind, name in makers.items()
        for number in (0, 1)
    ]
    selection = ("sensor_selection", 0, "uint32_t accel_device_id;", "I", lambda k: (101,))
    return write_ulog_topics(path, flight, [*topics, selection])


def numbers(line):
    """Return the numbers in a line of differences: attitude, velocity and position, each rms and greatest."""
    return [float(text) for text in re.findall(r"[\d.]+(?:e[+-]\d+)?(?=[ )])", line.replace("build 1", ""))]


@pytest.mark.parametrize("firmware", ["px4", pytest.param("ardupilot", marks=pytest.mark.long)])
def test_estimates_are_compared_with_log_and_with_each_other(firmware, flight, tmp_path):
    write_bin(tmp_path / "f.bin", flight)
    builds = [f"--command={shlex.join(scripted(firmware, '--estimate', bias))}" for bias in (0, 0, 0.5)]
    done = lapwing("feed", tmp_path / "f.bin", "--firmware", firmware, *builds, "--skip", "0.5", "--set", "run.seed=2")
    lines = done.stdout.splitlines()
    digests = [line.rpartition("digest ")[2] for line in lines[:3]]
    assert digests[0] == digests[1] != digests[2]
    assert all("skew 0 ms" in line for line in lines[:3])
    differences = dict(line.split(": ") for line in lines[4:])
    attitude, _, velocity, _, position, _ = numbers(differences["log and build 1"])
    assert attitude < 0.2
    assert velocity < 0.05
    assert position < 0.05
    assert numbers(differences["build 1 and build 2"]) == [0.0] * 6
    assert numbers(differences["build 1 and build 3"])[2:4] == [0.5, 0.5]


@pytest.mark.parametrize("writer", [write_bin, write_ulog_with_two_imus])
def test_each_imu_of_the_log_is_played(writer, flight, tmp_path):
    path = writer(tmp_path / ("f.bin" if writer is write_bin else "f.ulg"), flight)
    command = shlex.join(scripted("px4", "--estimate", 0, "--received", tmp_path / "received.txt"))
    lapwing("feed", path or tmp_path / "f.bin", "--firmware", "px4", f"--command={command}", "--skip", "0.5")
    received = (tmp_path / "received.txt").read_text().splitlines()
    assert [line for line in received if line.startswith("HIL_SENSOR")] == ["HIL_SENSOR 1"]


def test_what_is_missing_is_named(flight, tmp_path):
    write_bin(tmp_path / "f.bin", flight)
    done = lapwing("feed", tmp_path / "f.bin", "--firmware", "betaflight", code=2)
    assert "--firmware betaflight: expected px4 or ardupilot" in done.stderr
