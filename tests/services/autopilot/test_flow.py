"""Optical flow in the estimator: its rows, its consistency, and flights without a satellite receiver."""

import math

import estimator_flight as ef
import numpy as np
import pytest
from flights import ENABLED, error, fly_by_sensors, inject, mode, place, sent_texts

import lapwing
from lapwing.dynamics.lie.quaternion import exp, from_roll_pitch_yaw, multiply, rotation_matrix
from lapwing.dynamics.noise import TURN_ON, normal3, stream_key
from lapwing.kernels import kernel
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.estimator import filter_state, heading_and_velocity_fusion
from lapwing.services.common.failure_types import OFF
from lapwing.services.sensors import gps, imu, magnetometer, optical_flow, sonar

SEEDS = 40
OUTAGE, END = 15.0, 35.0  # [s]
P = estimator.PRESETS["rtk"]


@pytest.mark.parametrize("axis", range(2))
def test_row_against_differences_and_sensor(axis):
    """The row is the change of a camera's flow by errors of attitude and velocity."""
    attitude, velocity, distance = from_roll_pitch_yaw(0.3, -0.2, 1.0), np.array([2.0, -1.0, 0.5]), 4.0
    memory = ef.estimator.initial(
        P, ef.estimator.new_memory(), (0.0, 0.0, 0.0), (0.0, 0.0, 9.81), P.magnetic_field_world
    ).memory
    r = tuple(rotation_matrix(attitude))

    def camera_flow(q, v):
        ahead, left, _ = np.array(rotation_matrix(q)).reshape(3, 3).T @ v
        return (left / distance, -ahead / distance)[axis]

    expected = heading_and_velocity_fusion.flow_row(memory, r, tuple(velocity), axis, distance)
    assert expected == pytest.approx(camera_flow(attitude, velocity))
    h = 1e-6
    for i in range(3):
        small = np.eye(3)[i] * h
        after_rotation = camera_flow(multiply(exp(tuple(small)), attitude), velocity)
        assert memory.row[filter_state.THETA + i] == pytest.approx((after_rotation - expected) / h, abs=1e-5)
        after_acceleration = camera_flow(attitude, velocity + small)
        assert memory.row[filter_state.VELOCITY + i] == pytest.approx((after_acceleration - expected) / h, abs=1e-5)


@kernel
def fly(p, memory, instruments, keys, start, sees, out):
    """Fly the path of `estimator_flight`, without a satellite receiver after OUTAGE. Write ten rows per second."""
    imu_p, mag_p, gps_p, sonar_p, flow_p = instruments
    imu_k, mag_k, gps_k, sonar_k, flow_k = keys
    truth = ef.truth_at(0.0, 1.0)
    imu_s, mag_s = imu.initial(imu_p, imu_k, truth), magnetometer.initial(mag_p, mag_k, truth)
    gps_s, sonar_s = gps.initial(gps_p, gps_k, truth), sonar.initial(sonar_p, sonar_k, truth)
    flow_s = optical_flow.initial(flow_p, flow_k, truth)
    imu_s, i = imu.sample(imu_p, imu_s, imu_k, -2, truth)
    mag_s, m = magnetometer.sample(mag_p, mag_s, mag_k, -2, truth)
    s = estimator.initial(p, memory, start, i.specific_force_body, m.field_body)
    for tick in range(round(END / ef.INTERVAL)):
        t = tick * ef.INTERVAL
        truth = ef.truth_at(t, 1.0)
        imu_s, i = imu.sample(imu_p, imu_s, imu_k, tick, truth)
        s = estimator.predict(
            p, s, i.omega_body, i.specific_force_body, i.omega_variance, i.specific_force_variance, i.valid
        )
        if t < ef.STAND - 0.1 and tick % 10 == 0:
            s = estimator.update_standstill(p, s, i.omega_variance, i.specific_force_variance)
        if tick % 5 == 0:
            mag_s, m = magnetometer.sample(mag_p, mag_s, mag_k, tick, truth)
            s = estimator.update_magnetometer(p, s, m.field_body, m.variance, m.valid)
        if tick % 25 == 0:
            gps_s, g = gps.sample(gps_p, gps_s, gps_k, tick, truth)
            age, valid = round(g.age / ef.INTERVAL), g.valid and t < OUTAGE
            s = estimator.update_gps(p, s, g.latitude_deg, g.longitude_deg, g.height, g.position_variance, age, valid)
            s = estimator.update_gps_velocity(p, s, g.velocity_world, g.velocity_variance, age, valid)
            sonar_s, d = sonar.sample(sonar_p, sonar_s, sonar_k, tick, truth)
            s = estimator.update_sonar(p, s, d.range, d.variance, d.valid)
        if tick % 5 == 0:
            flow_s, f = optical_flow.sample(flow_p, flow_s, flow_k, tick, truth)
            if sees:
                s = estimator.update_flow(p, s, f.flow, f.rate, f.distance, f.variance, f.valid)
        if tick % 25 == 0:
            ef.write(out[tick // 25], p, s, truth)


def flights(sees):
    """Return errors (SEEDS, n, 9), their covariance in the filter (SEEDS, n, 9, 9) and the health flags (SEEDS, n)."""
    names = ("imu", "magnetometer", "gps", "sonar", "optical_flow")
    chosen = (imu.PRESETS["mpu6000"], next(iter(magnetometer.PRESETS.values())), gps.PRESETS["rtk"])
    instruments = (*chosen, next(iter(sonar.PRESETS.values())), optical_flow.PMW3901)
    out = np.zeros((SEEDS, round(END / ef.INTERVAL) // 25, ef.COLUMNS))
    for seed in range(SEEDS):
        keys = tuple(stream_key(seed, "drone1", name) for name in names)
        draw = normal3(keys[0], TURN_ON, 999)
        guess = (P.start_std * draw[0], P.start_std * draw[1], ef.REST + P.start_std * draw[2])
        fly(P, estimator.new_memory(), instruments, keys, guess, sees, out[seed])
    return out[..., :9], out[..., ef.COVARIANCE :].reshape(*out.shape[:2], 9, 9), out[..., ef.HEALTH].astype(int)


@pytest.mark.long
def test_flow_without_gps_bounds_drift_consistently():
    with_flow, covariance, health = flights(True)
    without, _, health_without = flights(False)
    before, out = slice(60, 145), slice(160, None)
    assert np.array_equal(with_flow[:, before], without[:, before])  # not used with a receiver
    drift, drift_without = (np.sqrt(np.mean(e[:, -1, 6:8] ** 2)) for e in (with_flow, without))
    assert drift < 0.2 * drift_without
    std = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    assert np.mean(np.abs(with_flow[:, out, 3:8]) < 3.0 * std[:, out, 3:8]) > 0.98
    horizontal = np.ix_(range(SEEDS), range(160, with_flow.shape[1]), [3, 4], [3, 4])
    velocity = with_flow[:, out, 3:5, None]
    nees = (velocity * np.linalg.solve(covariance[horizontal], velocity)).sum(axis=(-2, -1))
    assert 0.3 < nees.mean() / 2.0 < 1.5
    lost = 1 << filter_state.GPS
    assert not np.any(health[:, out] & lost)
    assert np.all(health_without[:, out] & lost)


@pytest.mark.long
def test_flight_continues_on_optical_flow_without_gps():
    script = {9: [inject("gps", OFF)]}
    seeing = fly_by_sensors(24, script, ENABLED, "sensors.optical_flow.preset=pmw3901")
    assert not any("position is lost" in text for text in sent_texts(seeing))
    assert mode(seeing, 24.0) == "hold"
    assert math.dist(place(seeing, 24.0), place(seeing, 9.0)) < 1.5
    blind = fly_by_sensors(24, script, ENABLED)
    assert any("position is lost" in text for text in sent_texts(blind))
    assert error(seeing, 9.0) < 0.5 * error(blind, 9.0)


@pytest.mark.long
def test_optical_flow_bounds_position_error_under_bridge():
    """Compare the shipped scene with the same scene after the camera fails."""

    def drift(flight):
        """Return the longest time without a fix [s] and the largest horizontal error of the estimate meanwhile [m]."""
        fix = flight.topic("gps/fix")
        lost = fix.times[fix["status.status"] < 0]
        estimate, truth = flight.estimate, flight.truth
        inside = (estimate.times > lost[0]) & (estimate.times < lost[-1])
        true = np.array([np.interp(estimate.times[inside], truth.times, truth.position[:, i]) for i in range(2)]).T
        return np.ptp(lost), np.linalg.norm(estimate.position[inside, :2] - true, axis=1).max()

    seeing = lapwing.fly("bridge")
    assert seeing.landed
    lost, error = drift(seeing)
    assert lost > 20.0
    assert error < 0.25
    dark = [{"kind": "dropout", "start": 5.0}]
    blind = lapwing.fly("bridge", {"sensors.optical_flow.faults": dark, "run.duration": 20.0})
    assert any(event.text == "the position is lost" for event in blind.events)
    assert drift(blind)[1] > 3.0 * error
