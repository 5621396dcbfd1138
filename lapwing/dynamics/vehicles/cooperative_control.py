"""Three controllers for the cooperative load: load tracking, link directions, attitudes (Lee, Sreenath, Kumar 2013).

Pure: (p, t, x) -> LiftCommand, for the control service and the closed loop alike (theory, eqs. (7.22) to (7.27)).
"""

from typing import NamedTuple

from lapwing.dynamics.vector import Vec3, add
from lapwing.dynamics.vehicles import cooperative_forces as forces
from lapwing.dynamics.vehicles import cooperative_load as formation
from lapwing.dynamics.vehicles.cooperative_load import COMMANDS, LiftCommand, load_acceleration
from lapwing.kernels import kernel
from lapwing.kernels.codegen import map_index


class FormationControl(NamedTuple):
    """Gains, the load's desired path and the links' desired directions (one for each quadrotor, fixed)."""

    load_position_gain: float  # [1/s^2]
    load_velocity_gain: float  # [1/s]
    link_direction_gain: float  # [1/s^2]
    link_rate_gain: float  # [1/s]
    attitude_gain: float  # [N m], before the scaling by epsilon^2
    attitude_rate_gain: float  # [N m s], before the scaling by epsilon
    epsilon: float
    path: tuple[Vec3, Vec3, Vec3]  # [m] desired load position is path[0] + path[1] t + path[2] t^2
    direction: tuple[Vec3, ...]  # desired unit link directions, quadrotor to load


@kernel
def formation_control(p, t, x):
    """Return thrusts and moments of all quadrotors at time t (theory, eqs. (7.22) to (7.27))."""
    desired, slope = forces.desired_specific_force(p, t, x, (0.0, 0.0, 0.0))
    s, s_rate = forces.shares(p, x, desired, slope)
    thrust = map_index(forces.quad_thrust, x.link, p, x, desired, slope, s, s_rate)
    # the thrusts give the accelerations, and these the rates of the desired forces
    force = map_index(formation.thrust_world, x.link, x, thrust)
    specific = load_acceleration(p, x, force)
    desired, slope = forces.desired_specific_force(p, t, x, add(specific, (0.0, 0.0, -p.gravity)))
    s, s_rate = forces.shares(p, x, desired, slope)
    return LiftCommand(thrust, map_index(forces.quad_moment, x.link, p, x, desired, slope, s, s_rate, force, specific))


COMMANDS[FormationControl] = formation_control
