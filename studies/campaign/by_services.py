"""A flight of a campaign by the services themselves: what the compiled loop cannot fly, and its yardstick."""

import numpy as np

from messages.topics import ACTUATORS, ESTIMATE, SETPOINT, STATUS, TRUTH
from services.lockstep import LockStepError
from services.scene import Scene
from services.sections import Exchange, Rates
from services.single import run_single
from services.table import lockstep_services
from studies.campaign.record import FlightRecord, Flown
from studies.flight import Messages


def fly(scene: Scene) -> Flown:
    """Fly the scene in this process, an estimate every tick."""
    scene = scene.replaced(scene[Rates].model_copy(update={"estimate": scene[Exchange].rate}))
    messages, finite = Messages(scene, (TRUTH, SETPOINT, ACTUATORS, ESTIMATE, STATUS)), True
    try:
        run_single(scene, lockstep_services(scene), messages, None, lambda *_: False)
    except LockStepError:
        finite = False
    truth, setpoints, actuators, estimates = (messages.of[t] for t in (TRUTH, SETPOINT, ACTUATORS, ESTIMATE))
    n = min(len(truth), len(setpoints), len(actuators), len(estimates))
    status = messages.of[STATUS]
    record = FlightRecord(
        position_world=_rows([m.pose.position for m in truth], n, 3),
        attitude=_rows([m.pose.orientation for m in truth], n, 4)[:, [3, 0, 1, 2]],
        velocity_world=_rows([m.velocity for m in truth], n, 3),
        omega_body=_rows([m.angular_velocity for m in truth], n, 3),
        power=np.array([sum(m.motor_power) for m in truth[:n]]),
        in_contact=np.array([m.ground_contact for m in truth[:n]], bool),
        setpoint_world=_rows([(*m.position, m.yaw) for m in setpoints], n, 4),
        tilt_reference=_rows([(m.attitude_reference.x, m.attitude_reference.y) for m in actuators], n, 2),
        motor_voltage=_rows([m.motor_voltage for m in actuators], n, 4),
        armed=np.array([m.armed for m in actuators[:n]], bool),
        estimated_world=_rows([m.pose.position for m in estimates], n, 3),
        estimated_attitude=_rows([m.pose.orientation for m in estimates], n, 4)[:, [3, 0, 1, 2]],
        position_std=_rows([m.position_std for m in estimates], n, 3),
        health=np.array([m.health for m in estimates[:n]]),
    )
    return Flown(record, finite, bool(status and status[-1].finished))


def _rows(values: list, n: int, width: int) -> np.ndarray:
    return np.array(values[:n], float).reshape(n, width)
