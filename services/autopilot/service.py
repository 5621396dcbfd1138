"""Autopilot service: computes motor commands from sensors or ground truth, and from references."""

import math
from typing import Any

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.kernels.cell import Cell
from lapwing.messages import topics as topic
from lapwing.services.autopilot import block, imu_vote, motor_failure
from lapwing.services.autopilot.block import FLIGHT, NO_TRAJECTORY, ORDER, Controller, Flight
from lapwing.services.autopilot.commander.prearm_checks import NOT_STARTED
from lapwing.services.autopilot.commander.wakeup_conditions import battery_thresholds
from lapwing.services.autopilot.commander_block import CommanderBlock, Operator, controller, flies_px4_cascade
from lapwing.services.autopilot.commander_wakeup import WakeupParameters
from lapwing.services.autopilot.custom.custom_blocks import controller_blocks, estimator_blocks
from lapwing.services.autopilot.encoders import imu_selection_encoder, topic_encoders
from lapwing.services.autopilot.estimator import Estimator
from lapwing.services.autopilot.estimator.blocks.correction import Correction
from lapwing.services.autopilot.estimator.blocks.covariance import CovarianceOutput
from lapwing.services.autopilot.estimator.blocks.estimate import FilterEstimate
from lapwing.services.autopilot.estimator.blocks.gps_block import GpsFusion
from lapwing.services.autopilot.estimator.blocks.ground_truth import TrueEstimate
from lapwing.services.autopilot.estimator.blocks.imu_switch import ImuSwitch
from lapwing.services.autopilot.estimator.blocks.inertial import STANDSTILL_EVERY, InertialNavigation
from lapwing.services.autopilot.estimator.blocks.navigation_state import blank
from lapwing.services.autopilot.estimator.blocks.terrain_height import GroundReference
from lapwing.services.autopilot.failure_injection.injection_blocks import Injection
from lapwing.services.autopilot.px4 import block as px4_block
from lapwing.services.autopilot.px4 import law as px4_law
from lapwing.services.autopilot.px4.block import Px4Controller
from lapwing.services.autopilot.service_config import AutopilotSetup
from lapwing.services.common import ports
from lapwing.services.common.autopilot_parameters import GPS_HEIGHT, SONAR_HEIGHT
from lapwing.services.common.encoders import airspeed_encoder
from lapwing.services.common.failure_types import SOUND, Faults, with_satellites
from lapwing.services.common.ports import EstimateCovariance, StateEstimate

NAME = "autopilot"
NO_HEIGHT = 1e8  # [m^2] variance of an ignored height
BOUNCE = 1.0  # [s] of possible motion after a touch-down


def create(setup: RunConfig, operator: Operator = lambda tick: ()) -> Service:
    """Return the autopilot of a run.

    Args:
        setup: run configuration.
        operator: returns the commands received until a tick, in addition to those of the plan.
    """
    config: AutopilotSetup = setup.services[NAME].parameters
    outputs = {port.name: port for port in setup.services[NAME].ports}
    values = {p.name: p.default for p in config.parameters}
    law, thresholds = Cell(controller(config, values)), Cell(battery_thresholds(values))
    px4 = Cell(px4_law.build(values, config.airframe)) if flies_px4_cascade(config) else None
    detector = Cell(motor_failure.build(config.airframe, values))
    wakeup = WakeupParameters(thresholds)
    service = Service(NAME, [], [])

    def operator_commands(tick: int) -> list[Any]:
        return [*(config.plan if tick == 0 else ()), *operator(tick)]

    sound, motors = (SOUND,) * config.imus, (SOUND,) * len(config.airframe.rotor_x)
    no_faults = with_satellites(Faults(gyro=sound, accelerometer=sound, motors=motors), values, config.has_gps)
    faults = Cell(no_faults) if config.operator else None
    sensor_ports = () if config.own_estimator else [i.port for i in setup.services[NAME].inputs]
    injection = Injection(faults, setup, sensor_ports, config.airframe.motor)
    commander = CommanderBlock(config, law, thresholds, detector, service, operator_commands, injection, px4)
    reference = ports.TRAJECTORY if config.phases else NO_TRAJECTORY
    common = Controller(law, detector, thresholds, setup.interval, round(BOUNCE / setup.interval))
    battery, actuators = injection.received(ports.BATTERY), outputs[ports.ACTUATORS]
    inputs = (InputPort(ports.ESTIMATE), InputPort(ORDER), InputPort(battery), InputPort(reference))
    control_outputs = (
        injection.commanded(actuators),
        outputs[ports.SETPOINT],
        outputs[ports.STATUS],
        Port(FLIGHT, Flight()),
    )
    if px4 is not None:
        cascade = Px4Controller(common, px4)
        control = [Block(f"{NAME}.control", cascade, Cell(px4_block.start(cascade)), inputs, control_outputs)]
    elif config.controller is None:
        control = [Block(f"{NAME}.control", common, Cell(block.start(common)), inputs, control_outputs)]
    else:
        control = controller_blocks(f"{NAME}.control", setup.modules, config, common, inputs, control_outputs)
    navigation = _navigation(setup, config, wakeup, outputs[ports.ESTIMATE], injection)
    service.parts = [*injection.before(NAME), *navigation, commander, *control, *injection.after(NAME, actuators)]
    phases, status_texts = commander.phases.table, commander.status_texts.table
    service.encoders = topic_encoders(setup, config.estimate_every, config.status_every, phases, status_texts)
    if ports.AIRSPEED in sensor_ports:
        airspeed_port = setup.port(ports.AIRSPEED)._replace(name=injection.received(ports.AIRSPEED))
        service.encoders.append(airspeed_encoder(topic.AIRSPEED_RECEIVED, setup.vehicle, airspeed_port))
    if config.imus > 1:
        service.encoders.append(imu_selection_encoder(setup.vehicle, config.imu_every))
    service.python_topics = (topic.OPERATOR, topic.COMMAND_ACKS) if config.operator else ()
    return service


def _vote(config: AutopilotSetup, p: Estimator, state: Cell, selected: Port, injection: Injection) -> list[Block]:
    """Return the blocks between redundant inertial measurement units and the estimator."""
    readings = tuple(InputPort(injection.received(unit)) for unit in ports.IMUS[: config.imus])
    result, every = Port(ports.IMU_SELECTION, ports.ImuSelection(), config.imu_every), config.imu_every
    vote = Block(
        f"{NAME}.imu_vote", imu_vote.Vote(p.frozen), Cell(imu_vote.VoteState()), readings, (selected, result), every
    )
    return [vote, Block(f"{NAME}.imu_switch", ImuSwitch(p), state, (InputPort(ports.IMU_SELECTION),), (), every)]


def _navigation(
    setup: RunConfig, config: AutopilotSetup, wakeup: WakeupParameters, estimate: Port, injection: Injection
) -> list[Block]:
    """Return the estimator blocks in order."""
    battery, flight = InputPort(injection.received(ports.BATTERY)), InputPort(FLIGHT, 1)
    p = config.estimator
    if config.own_estimator is not None:
        names = [port.name for port in setup.services["sensors"].ports] if "sensors" in setup.services else []
        sensors = {name: setup.port(name).period for name in names}
        return estimator_blocks(f"{NAME}.estimate", setup.modules, config, wakeup, sensors, (battery, flight), estimate)
    if p is None:
        inputs = (InputPort(ports.TRUTH), battery, flight)
        return [Block(f"{NAME}.estimate", TrueEstimate(wakeup), Cell(0.0), inputs, (estimate,))]
    state = Cell(blank())
    height_reference = next(q.default for q in config.parameters if q.name == "EKF2_HGT_REF")
    over_ground = GroundReference(p._replace(sonar_height_max=math.inf))
    known_ports = setup.ports
    inertial = InertialNavigation(p, config.start_world, STANDSTILL_EVERY * config.imu_every)
    imu, parts = injection.received(ports.IMU), []
    if config.imus > 1:
        imu = "imu.selected"
        parts = _vote(config, p, state, known_ports[ports.IMU]._replace(name=imu), injection)
    inputs = (InputPort(imu), InputPort(injection.received(ports.MAGNETOMETER)), flight)
    parts += [Block(f"{NAME}.inertial", inertial, state, inputs, (), config.imu_every)]
    for port, fusion in (
        (ports.MAGNETOMETER, Correction(p)),
        (ports.BAROMETER, Correction(p)),
        (ports.GPS, GpsFusion(p, config.gps_age, 0.0 if height_reference == GPS_HEIGHT else NO_HEIGHT)),
        (config.distance_sensor or ports.SONAR, over_ground if height_reference == SONAR_HEIGHT else Correction(p)),
        (ports.OPTICAL_FLOW, Correction(p)),
    ):
        if port in known_ports:
            reading = InputPort(injection.received(port))
            parts.append(Block(f"{NAME}.{port}", fusion, state, (reading,), (), known_ports[port].period))
    before_start = StateEstimate(position_world=config.start_world, health=NOT_STARTED)
    estimate_block = FilterEstimate(p, wakeup, before_start)
    parts.append(Block(f"{NAME}.estimate", estimate_block, state, (battery, flight), (estimate,)))
    if ports.ESTIMATE_COVARIANCE in known_ports:  # not in logs of former versions
        covariance_port = known_ports[ports.ESTIMATE_COVARIANCE]
        output = CovarianceOutput(EstimateCovariance())
        parts.append(Block(f"{NAME}.covariance", output, state, (), (covariance_port,), covariance_port.period))
    return parts
