"""What an adapter tells its partners about: the vehicle's newest words, what it passes for, and what it was told."""

from types import ModuleType

from dynamics.vehicles.airframe import Airframe
from messages import Status
from messages.topics import STATUS
from services.mavlink import flavours
from services.mavlink.config import Mavlink
from services.mavlink.frames import whole
from services.mavlink.view import HOME, Motion, View
from services.scene import Scene
from services.sections import Vehicle as Named
from services.sections import airframe

COMPONENT = 1  # MAV_COMP_ID_AUTOPILOT1
STANDING = Status(landed=True)  # before the vehicle has said anything


class Vehicle:
    """One vehicle on its links."""

    def __init__(self, scene: Scene):
        """Of a scene; says nothing of itself before the first message has come."""
        self.system = scene[Mavlink].system
        self.flavour: ModuleType = flavours.get(scene[Mavlink].flavour)
        self.name: str = scene[Named].name
        self.airframe: Airframe = airframe(scene)
        self.on_truth = not scene.tables("sensors")  # nothing is measured: the truth stands for the sensors
        self.view = View()
        self.time_ns = 0
        self.origin = (
            whole(HOME.latitude_deg * 1e7, 32),
            whole(HOME.longitude_deg * 1e7, 32),
            whole(1e3 * HOME.height, 32),
        )

    @property
    def boot_ms(self) -> int:
        """Time since the start [ms], as fields of 32 bits hold it."""
        return self.time_ns // 1_000_000 & 0xFFFFFFFF

    @property
    def boot_us(self) -> int:
        """Time since the start [us]."""
        return self.time_ns // 1000

    @property
    def status(self) -> Status:
        """What the autopilot is doing."""
        return self.view.get(STATUS) or STANDING

    @property
    def motion(self) -> Motion | None:
        """Where it believes to be."""
        return self.view.motion()
