"""Autopilot service: computes motor commands from sensors or ground truth, and from references."""

import math
from typing import Any

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import Service
from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.kernels.cell import Cell
from lapwing.messages import topics as topic
from lapwing.services.autopilot import block, imu_vote, landing_block, motor_failure
from lapwing.services.autopilot.block import FLIGHT, NO_TRAJECTORY, ORDER, Controller, Flight
from lapwing.services.autopilot.commander.prearm_checks import NOT_STARTED
from lapwing.services.autopilot.commander.wakeup_conditions import battery_thresholds
from lapwing.services.autopilot.commander_block import CommanderBlock, Operator, controller, landing_parameters
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
from lapwing.services.autopilot.landing_block import LANDING, Landing, LandingParameters
from lapwing.services.autopilot.service_config import AutopilotConfig
from lapwing.services.common import ports
from lapwing.services.common.autopilot_parameters import GPS_HEIGHT, SONAR_HEIGHT
from lapwing.services.common.encoders import airspeed_encoder
from lapwing.services.common.failure_types import SOUND, Faults, with_satellites
from lapwing.services.common.ports import EstimateCovariance, StateEstimate

NAME = "autopilot"
NO_HEIGHT = 1e8  # [m^2] variance of an ignored height
BOUNCE = 1.0  # [s] of possible motion after a touch-down


def create(config: RunConfig, operator: Operator = lambda tick: ()) -> Service:
    """Return the autopilot of a run.

    Args:
        config: run configuration.
        operator: returns the commands received until a tick, in addition to those of the plan.
    """
    settings: AutopilotConfig = config.services[NAME].parameters
    outputs = {port.name: port for port in config.services[NAME].ports}
    values = {p.name: p.default for p in settings.parameters}
    law, thresholds = Cell(controller(settings, values)), Cell(battery_thresholds(values))
    detector = Cell(motor_failure.build(settings.airframe, settings.gyro_range, values))
    landing = Cell(landing_parameters(settings, values))
    wakeup = WakeupParameters(thresholds)
    service = Service(NAME, [], [])

    def operator_commands(tick: int) -> list[Any]:
        return [*(settings.plan if tick == 0 else ()), *operator(tick)]

    sound, motors = (SOUND,) * settings.imus, (SOUND,) * len(settings.airframe.rotor_x)
    no_faults = with_satellites(Faults(gyro=sound, accelerometer=sound, motors=motors), values, settings.has_gps)
    faults = Cell(no_faults) if settings.operator else None
    sensor_ports = () if settings.own_estimator else [i.port for i in config.services[NAME].inputs]
    injection = Injection(faults, config, sensor_ports, settings.airframe.motor)
    commander = CommanderBlock(settings, law, thresholds, detector, service, operator_commands, injection, landing)
    reference = ports.TRAJECTORY if settings.phases else NO_TRAJECTORY
    common = Controller(law, detector, thresholds, config.interval, round(BOUNCE / config.interval))
    battery, actuators = injection.received(ports.BATTERY), outputs[ports.ACTUATORS]
    commanded = injection.commanded(actuators)
    land_detector = Block(
        f"{NAME}.landing",
        LandingParameters(landing, config.interval),
        Cell(landing_block.START),
        (InputPort(ports.ESTIMATE), InputPort(ORDER), InputPort(reference), InputPort(commanded.name, 1)),
        (Port(LANDING, Landing()),),
    )
    inputs = (InputPort(ports.ESTIMATE), InputPort(ORDER), InputPort(battery), InputPort(LANDING))
    control_outputs = (commanded, outputs[ports.SETPOINT], outputs[ports.STATUS], Port(FLIGHT, Flight()))
    if settings.controller is None:
        control = [Block(f"{NAME}.control", common, Cell(block.start(common)), inputs, control_outputs)]
    else:
        control = controller_blocks(f"{NAME}.control", config.modules, settings, common, inputs, control_outputs)
    navigation = _navigation(config, settings, wakeup, outputs[ports.ESTIMATE], injection)
    service.blocks = [
        *injection.before(NAME),
        *navigation,
        commander,
        land_detector,
        *control,
        *injection.after(NAME, actuators),
    ]
    phases, status_texts = commander.phases.table, commander.status_texts.table
    service.encoders = topic_encoders(config, settings.estimate_every, settings.status_every, phases, status_texts)
    if ports.AIRSPEED in sensor_ports:
        airspeed_port = config.port(ports.AIRSPEED)._replace(name=injection.received(ports.AIRSPEED))
        service.encoders.append(airspeed_encoder(topic.AIRSPEED_RECEIVED, config.vehicle, airspeed_port))
    if settings.imus > 1:
        service.encoders.append(imu_selection_encoder(config.vehicle, settings.imu_every))
    service.python_topics = (topic.OPERATOR, topic.COMMAND_ACKS) if settings.operator else ()
    return service


def _vote(config: AutopilotConfig, p: Estimator, state: Cell, selected: Port, injection: Injection) -> list[Block]:
    """Return the blocks between redundant inertial measurement units and the estimator."""
    readings = tuple(InputPort(injection.received(unit)) for unit in ports.IMUS[: config.imus])
    result, every = Port(ports.IMU_SELECTION, ports.ImuSelection(), config.imu_every), config.imu_every
    vote = Block(
        f"{NAME}.imu_vote", imu_vote.Vote(p.frozen), Cell(imu_vote.VoteState()), readings, (selected, result), every
    )
    return [vote, Block(f"{NAME}.imu_switch", ImuSwitch(p), state, (InputPort(ports.IMU_SELECTION),), (), every)]


def _navigation(
    config: RunConfig, settings: AutopilotConfig, wakeup: WakeupParameters, estimate: Port, injection: Injection
) -> list[Block]:
    """Return the estimator blocks in order."""
    battery, flight = InputPort(injection.received(ports.BATTERY)), InputPort(FLIGHT, 1)
    p = settings.estimator
    if settings.own_estimator is not None:
        names = [port.name for port in config.services["sensors"].ports] if "sensors" in config.services else []
        sensors = {name: config.port(name).period for name in names}
        return estimator_blocks(
            f"{NAME}.estimate", config.modules, settings, wakeup, sensors, (battery, flight), estimate
        )
    if p is None:
        inputs = (InputPort(ports.TRUTH), battery, flight)
        return [Block(f"{NAME}.estimate", TrueEstimate(wakeup), Cell(0.0), inputs, (estimate,))]
    state = Cell(blank())
    height_reference = next(q.default for q in settings.parameters if q.name == "EKF2_HGT_REF")
    over_ground = GroundReference(p._replace(sonar_height_max=math.inf))
    known_ports = config.ports
    inertial = InertialNavigation(p, settings.start_world, STANDSTILL_EVERY * settings.imu_every)
    imu, blocks = injection.received(ports.IMU), []
    if settings.imus > 1:
        imu = "imu.selected"
        blocks = _vote(settings, p, state, known_ports[ports.IMU]._replace(name=imu), injection)
    inputs = (InputPort(imu), InputPort(injection.received(ports.MAGNETOMETER)), flight)
    blocks += [Block(f"{NAME}.inertial", inertial, state, inputs, (), settings.imu_every)]
    for port, fusion in (
        (ports.MAGNETOMETER, Correction(p)),
        (ports.BAROMETER, Correction(p)),
        (ports.GPS, GpsFusion(p, settings.gps_age, 0.0 if height_reference == GPS_HEIGHT else NO_HEIGHT)),
        (settings.distance_sensor or ports.SONAR, over_ground if height_reference == SONAR_HEIGHT else Correction(p)),
        (ports.OPTICAL_FLOW, Correction(p)),
    ):
        if port in known_ports:
            reading = InputPort(injection.received(port))
            blocks.append(Block(f"{NAME}.{port}", fusion, state, (reading,), (), known_ports[port].period))
    before_start = StateEstimate(position_world=settings.start_world, health=NOT_STARTED)
    estimate_block = FilterEstimate(p, wakeup, before_start)
    blocks.append(Block(f"{NAME}.estimate", estimate_block, state, (battery, flight), (estimate,)))
    if ports.ESTIMATE_COVARIANCE in known_ports:  # not in logs of former versions
        covariance_port = known_ports[ports.ESTIMATE_COVARIANCE]
        output = CovarianceOutput(EstimateCovariance())
        blocks.append(Block(f"{NAME}.covariance", output, state, (), (covariance_port,), covariance_port.period))
    return blocks
