"""Scene table and parameters of the ground contact, with stick-slip or regularised friction."""

from typing import Annotated, Any, Literal, NamedTuple

from annotated_types import Ge, Gt, Le

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._from_scene import Airframe, reject, validate_table
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.terrain import LEVEL, upright
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.kernels import math

Coefficient = Annotated[float, Ge(0), Le(5)]
Stiffness = Annotated[float, Gt(0), Le(1e9)]
Slip = Annotated[float, Ge(1e-6), Le(10)]


class Settings(NamedTuple):
    """Scene table."""

    friction: Literal["stick_slip", "regularised"] = "stick_slip"  # spring with slider, or function of slip speed
    stiffness: Stiffness = 1.0e6  # [N/m] of one foot
    damping: Annotated[float, Ge(0), Le(1e6)] = 1.0e3  # [N s/m] of one foot
    transition_width: Annotated[float, Ge(1e-7), Le(0.1)] = 1.0e-4  # [m] depth over which the normal force sets in
    friction_static: Coefficient = 0.5  # coefficient of a foot at rest
    friction_dynamic: Coefficient = 0.3  # coefficient of a foot that slides
    tangential_stiffness: Stiffness = 2.0e5  # [N/m] of one foot that sticks; friction "stick_slip"
    stiction_velocity: Slip = 0.15  # [m/s] slip at which the dynamic coefficient is reached; friction "stick_slip"
    critical_velocity: Slip = 1.0e-3  # [m/s] slip of the maximum friction; friction "regularised"


class GroundContact(NamedTuple):
    """Feet that stick until the friction cone is exceeded (theory, eq. (2.12) to (2.16)).

    The friction is a spring and damper in series with a Coulomb slider, whose coefficient falls from the static to the
    dynamic one with the slip. Its deflection is a state under the integrator's error control: sticking, sliding and
    reversal are not events, and the motion depends continuously on its initial state. Source: Cundall and Strack,
    Geotechnique 29 (1979) 47, in its limit of short steps. Valid for hard ground and feet that are points; the ground
    is that of [environment].
    """

    terrain: Any  # Level or Relief
    feet: tuple[Vec3, ...]  # [m] body, with the hull's points
    reach: float  # [m] beyond which no foot can be from the centre of mass, measured along world z from the slope
    stiffness: float  # [N/m]
    damping: float  # [N s/m]
    inverse_width: float  # [1/m]
    static: float
    dynamic: float
    tangential_stiffness: float  # [N/m]
    tangential_damping: float  # [N s/m]
    inverse_stiction: float  # [s/m]
    rate_bound: float  # [1/s] of the fastest mode in contact

    @classmethod
    def from_scene(cls, table: dict, airframe: Airframe) -> "GroundContact | GroundContactSmooth":
        """Return the parameters with the airframe's feet and mass."""
        settings = validate_table(Settings, table)
        if settings.friction_dynamic > settings.friction_static:
            expected = f"at most friction_static = {settings.friction_static}"
            raise ConfigError("friction_dynamic", f"got {settings.friction_dynamic}", expected)
        points = airframe.contact or reject("the vehicle has no feet, [contact] in its file")
        feet = points.feet + points.hull
        common = (
            LEVEL, feet, _reach(feet), settings.stiffness, settings.damping, 1.0 / settings.transition_width,
            settings.friction_static, settings.friction_dynamic,
        )  # fmt: skip
        if settings.friction == "regularised":
            rate = _rate_bound(airframe, points.feet, (settings.stiffness, 0.0), (settings.damping, 0.0))
            return GroundContactSmooth(*common, 1.0 / settings.critical_velocity, rate, _mobility(airframe, feet))
        stiffness = (settings.stiffness, settings.tangential_stiffness)
        undamped = _rate_bound(airframe, points.feet, stiffness, (0.0, 0.0))
        damping = max(settings.damping, settings.tangential_stiffness / (FASTEST_DEFLECTION * undamped))
        rate = _rate_bound(airframe, points.feet, stiffness, (settings.damping, damping))
        rate = max(rate, settings.tangential_stiffness / damping * STABLE / STABLE_DAMPER)
        return cls(*common, settings.tangential_stiffness, damping, 1.0 / settings.stiction_velocity, rate)

    def in_environment(self, environment: Environment) -> "GroundContact":
        """Return the parameters over the scene's terrain."""
        return self._replace(terrain=environment.terrain, reach=_reach(self.feet, environment.terrain))

    def initial_discrete_state(self) -> tuple[Vec3, ...]:
        """Return zero deflections: no foot is on the ground."""
        return (ZERO,) * len(self.feet)


class GroundContactSmooth(NamedTuple):
    """Feet under a friction that is a function of velocity only (theory, eq. (2.17)).

    Source: the "smooth stick-slip" law that Pappalardo et al. 2023, section 6.1, take from Simscape Multibody. It
    creeps on a slope, and near rest it is a damper of about 1.5 mu_s m g / v_c, so stiff that steps are split while in
    contact.
    """

    terrain: Any  # Level or Relief
    feet: tuple[Vec3, ...]  # [m] body
    reach: float  # [m]
    stiffness: float  # [N/m]
    damping: float  # [N s/m]
    inverse_width: float  # [1/m]
    static: float
    dynamic: float
    inverse_critical: float  # [s/m]
    rate_bound: float  # [1/s]
    mobility: float  # [1/kg] maximum acceleration of a foot by a unit force on all feet

    def in_environment(self, environment: Environment) -> "GroundContactSmooth":
        """Return the parameters over the scene's terrain."""
        return self._replace(terrain=environment.terrain, reach=_reach(self.feet, environment.terrain))

    def initial_discrete_state(self) -> tuple[tuple[()], ...]:
        """Return an empty memory for each foot."""
        return ((),) * len(self.feet)


FASTEST_DEFLECTION = 10.0  # rate at which a deflection decays over the fastest undamped mode: the damper is no weaker
STABLE = 1.25  # [rad] of the fastest oscillation in one step
SUDDEN = 200.0  # [m/s^2] limit of the acceleration towards the ground
STABLE_REAL = 2.5  # decay rates times step: classical Runge-Kutta is stable to 2.78 on the real axis
STABLE_DAMPER = 2.75  # the same of the damper, whose rate is exact


def _reach(feet: tuple[Vec3, ...], terrain: Any = LEVEL) -> float:
    return max(math.hypot(*foot) for foot in feet) * math.hypot(*upright(terrain))


def _mobility(airframe: Airframe, points: tuple[Vec3, ...]) -> float:
    inertia = airframe.mass.inertia
    arm = max(point[0] * point[0] + point[1] * point[1] + point[2] * point[2] for point in points)
    return 1.0 / airframe.mass.total + arm / min(inertia)


def _rate_bound(
    airframe: Airframe, feet: tuple[Vec3, ...], stiffness: tuple[float, float], damping: tuple[float, float]
) -> float:
    """Return a close upper bound of the highest natural frequency [rad/s] of the vehicle on its springs.

    For a stronger damper, it is the frequency that requires equally short steps. Stiffness [N/m] and damping [N s/m] of
    a foot are (normal, tangential).
    """
    mass = airframe.mass
    xx, yy, zz = (math.total(foot[i] * foot[i] for foot in feet) for i in range(3))

    def highest(normal: float, tangential: float) -> float:
        heave = len(feet) * normal / mass.total
        roll = (normal * yy + tangential * zz) / mass.inertia[0]
        pitch = (normal * xx + tangential * zz) / mass.inertia[1]
        return max(heave, roll, pitch)

    return max(math.sqrt(highest(*stiffness)), highest(*damping) * STABLE / STABLE_DAMPER)
