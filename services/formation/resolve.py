"""Resolution of a scene's `[formation]` into the service's configuration."""

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics.vector import ZERO, norm, scale
from lapwing.papers.cooperative_load.cooperative_control import FormationControl
from lapwing.papers.cooperative_load.cooperative_load import CooperativeLoadParameters
from lapwing.services.common import ports
from lapwing.services.common.ports import RotorWrenches
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.run_schema import CooperativeLoad
from lapwing.services.formation.schema import Formation
from lapwing.services.formation.service import FormationLaw


def resolve(scene: Scene) -> ServiceConfig | None:
    """Return the configuration of the formation service. Return None if the scene has no `[formation]`."""
    if not scene.has(Formation):
        return None
    c, f = scene[CooperativeLoad], scene[Formation]
    law = FormationControl(
        f.load_position, f.load_velocity, f.link, f.link_rate, f.attitude, f.attitude_rate, f.epsilon, f.path,
        tuple(scale(1.0 / norm(d), d) for d in f.link_direction),
    )  # fmt: skip
    p = CooperativeLoadParameters(c.quad_mass, c.quad_inertia, c.link_length, c.load_mass, c.gravity, law)
    n = len(c.link_length)
    return ServiceConfig(
        FormationLaw(p, scene[Communication].interval),
        (InputPort(ports.BODIES),),
        (Port(ports.LIFT, RotorWrenches((0.0,) * n, (ZERO,) * n)),),
    )
