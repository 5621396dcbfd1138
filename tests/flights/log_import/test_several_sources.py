"""Imports of logs with several sources, restarts, unknown values and other vehicles."""

from dataclasses import replace

import flight_writers
import numpy as np
import pytest
from flight_recordings import BATTERY
from flight_writers import SAMPLES
from pymavlink.dialects.v20 import common as mavlink

from lapwing.flights.log_import.open_flight import open_flight


def check(result, flight):
    n = len(result)
    assert n >= SAMPLES - 2
    assert result.valid.all()
    assert result.position == pytest.approx(flight.position[:n], abs=2e-3)
    assert np.abs((result.attitude * flight.attitude[:n]).sum(axis=1)) == pytest.approx(np.ones(n), abs=1e-6)
    assert result.omega == pytest.approx(flight.omega[:n], abs=2e-3)
    assert result.motor_voltage == pytest.approx(flight.motor_voltage[:n], abs=5e-3)
    assert result.battery_voltage == pytest.approx(np.full(n, BATTERY), abs=1e-3)


def test_dataflash_follows_primary_core(dataflash, flight):
    def change(name, values):
        if name == "XKF1":
            yield "XKF4", (values[0], 0, 1)
            yield name, (*values[:-1], values[-1] + 5.0)
            yield name, (values[0], 1, *values[2:])
        elif name == "XKQ":
            yield name, (*values[:2], 1.0, 0.0, 0.0, 0.0)
            yield name, (values[0], 1, *values[2:])
        else:
            yield name, values

    result = dataflash(change, {"XKF4": (72, "QBb", "TimeUS,C,PI")})
    check(result, flight)
    assert "EKF core 1 was primary" in result.notes


def test_second_battery_of_former_dataflash_is_ignored(dataflash, flight):
    def change(name, values):
        if name == "BAT":
            yield name, (values[0], 1, 1.0, 1.0)
        yield name, values

    check(dataflash(change, {"BAT": (69, "QBff", "TimeUS,Instance,Volt,Curr")}), flight)


def test_damaged_time_hides_single_sample(dataflash, flight):
    def change(name, values):
        damaged = name == "IMU" and values[0] == 6_000_000 and values[1] == 0
        yield name, (values[0] + (damaged << 40), *values[1:])

    result = dataflash(change)
    assert result.faults == {"time not increasing": 2}  # gyroscope and accelerometer
    check(result, flight)


def test_log_of_plane_is_rejected(dataflash):
    def change(name, values):
        yield name, (*values[:2], 4.0) if name == "PARM" and values[1].startswith(b"SERVO") else values

    with pytest.raises(ValueError, match="expected a multirotor"):
        dataflash(change)


def test_motor_on_unlogged_output_is_rejected(dataflash):
    def change(name, values):
        yield name, (0, b"SERVO20_FUNCTION", 36.0) if name == "PARM" and values[1] == b"SERVO4_FUNCTION" else values

    with pytest.raises(ValueError, match="no motor outputs C20 in RCOU"):
        dataflash(change)


def test_dataflash_without_fix_has_no_positions_of_gps(dataflash, flight):
    def change(name, values):
        yield name, (*values[:2], 1 if values[0] < 7_000_000 else 3, *values[2:]) if name == "GPS" else values

    result = dataflash(change, {"GPS": (70, "QBBIHLLf", "TimeUS,I,Status,GMS,GWk,Lat,Lng,Alt")})
    assert result.readings["gps"].time[0] >= 2.0 - 1e-6
    check(result, flight)


@pytest.mark.parametrize("volts", [0.0, np.nan])
def test_unmeasured_battery_has_shares_of_voltage(dataflash, flight, volts):
    result = dataflash(lambda name, v: [(name, (*v[:2], volts, 0.0) if name == "BAT" else v)])
    assert result.motor_voltage == pytest.approx(flight.motor_voltage[: len(result)] / BATTERY, abs=2e-3)
    assert any("no battery voltage" in note for note in result.notes)


def test_battery_without_first_readings_keeps_one_unit(dataflash, flight):
    result = dataflash(lambda name, v: [(name, (*v[:2], 0.0, 0.0) if name == "BAT" and v[0] < 6_500_000 else v)])
    check(result, flight)
    assert result.faults == {"battery not measured": 150}


@pytest.mark.parametrize("name", ["f.bin", "f.tlog"])
def test_longest_part_between_restarts_is_imported(tmp_path, flight, name):
    write, path = flight_writers.WRITERS[name], tmp_path / name
    short = replace(flight, **{
        field: getattr(flight, field)[200:]
        for field in ("position", "attitude", "velocity", "omega", "specific_force", "motor_voltage",
                      "battery_voltage", "valid")
    })  # fmt: skip
    write(path, short)
    first = path.read_bytes()
    write(path, flight)
    path.write_bytes(first + path.read_bytes())
    result = open_flight(path)
    check(result, flight)
    assert any("the longest of 2 parts" in note for note in result.notes)


def test_telemetry_of_other_port_is_ignored(tlog, flight):
    def change(k, message):
        yield message
        if message.get_type() == "SERVO_OUTPUT_RAW":
            yield mavlink.MAVLink_servo_output_raw_message(message.time_usec + 5000, 1, *[1000 + k] * 8)

    check(tlog(change), flight)


def test_time_stamp_of_32_bits_wraps(tlog, flight, monkeypatch):
    monkeypatch.setattr(flight_writers, "BOOT", 2**32 * 1e-6 - 2.0)
    check(tlog(lambda k, message: [message]), flight)


def test_actuator_outputs_may_be_pulses(tlog, flight):
    def change(k, message):
        if message.get_type() == "SERVO_OUTPUT_RAW":
            pulses = 1000.0 + 1000.0 * flight.motor_voltage[k] / BATTERY
            yield mavlink.MAVLink_actuator_output_status_message(message.time_usec, 15, [*pulses, *[0.0] * 28])
        else:
            yield message

    check(tlog(change), flight)


def test_unknown_values_of_telemetry_are_not_numbers(tlog):
    def change(k, message):
        if message.get_type() == "SYS_STATUS":
            message.voltage_battery, message.current_battery = 65535, -1
        if message.get_type() == "GPS_RAW_INT":
            message.fix_type = 1
        yield message

    result = tlog(change)
    assert np.isnan(result.battery_voltage).all()
    assert "gps" not in result.readings


def test_unknown_current_leaves_voltage(tlog, flight):
    def change(k, message):
        if message.get_type() == "SYS_STATUS":
            message.current_battery = -1
        yield message

    result = tlog(change)
    check(result, flight)
    assert np.isnan(result.power).all()


def test_telemetry_of_rover_is_rejected(tlog):
    def change(k, message):
        yield mavlink.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3) if message.get_type() == "HEARTBEAT" else message

    with pytest.raises(ValueError, match="log of a rover; expected a multirotor"):
        tlog(change)


def test_parameters_in_telemetry_name_motors(tlog, flight):
    def change(k, message):
        if k == 0 and message.get_type() == "SYS_STATUS":
            for n, function in enumerate((35, 33, 34, 36), 1):
                yield mavlink.MAVLink_param_value_message(b"SERVO%d_FUNCTION" % n, function, 4, 100, n)
        if message.get_type() == "SERVO_OUTPUT_RAW":
            m1, m2, m3, m4 = (getattr(message, f"servo{n}_raw") for n in (1, 2, 3, 4))
            gimbal = 1000 + k
            message = mavlink.MAVLink_servo_output_raw_message(message.time_usec, 0, m3, m1, m2, m4, gimbal, 0, 0, 0)
        yield message

    check(tlog(change), flight)


def test_second_rangefinder_is_ignored(tlog):
    def change(k, message):
        yield message
        if message.get_type() == "SYS_STATUS":
            for number, orientation, distance in ((0, 0, 700), (1, 25, 300)):
                ms = 5000 + 10 * k
                yield mavlink.MAVLink_distance_sensor_message(ms, 10, 1000, distance, 0, number, orientation, 0)

    assert np.unique(tlog(change).readings["rangefinder"].values) == pytest.approx([3.0])
