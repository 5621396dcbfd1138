"""What an adapter tells its partners about: the vehicle's newest words, what it passes for, and what it was told."""

from types import ModuleType

from messages import Status
from messages.topics import STATUS
from services.mavlink import flavours
from services.mavlink.config import Mavlink
from services.mavlink.frames import whole
from services.mavlink.view import HOME, Motion, View
from services.scene import Scene, recorded_data
from services.sections import Vehicle as Named
from services.sections import airframe

COMPONENT = 1  # MAV_COMP_ID_AUTOPILOT1
STANDING = Status(landed=True)  # before the vehicle has said anything


class Vehicle:
    """One vehicle on its links."""

    def __init__(self, name: str, identity: Mavlink, full_voltage: float | None, on_truth: bool):
        """A vehicle that has said nothing yet.

        Args:
            name: first part of its topics' names.
            identity: who it says it is.
            full_voltage: of its motors [V]; None where it is not known.
            on_truth: nothing is measured, the truth stands for the sensors.
        """
        self.name, self.system, self.on_truth = name, identity.system, on_truth
        self.flavour: ModuleType = flavours.get(identity.flavour)
        self.full_voltage = full_voltage
        self.view = View()
        self.time_ns = 0
        latitude, longitude, height = HOME
        self.origin = whole(latitude * 1e7, 32), whole(longitude * 1e7, 32), whole(height * 1e3, 32)

    @classmethod
    def of(cls, scene: Scene) -> "Vehicle":
        """The vehicle of a scene that is flown."""
        engine = airframe(scene).motor
        voltage = engine.max_voltage if engine else None
        return cls(scene[Named].name, scene[Mavlink], voltage, not scene.tables("sensors"))

    @classmethod
    def recorded(cls, text: str) -> "Vehicle":
        """The vehicle of a scene as a log carries it. Raises ValueError for one that is none."""
        data = recorded_data(text)
        identity = Mavlink.model_validate(data.get("mavlink", {}))
        return cls(data.get("vehicle", {}).get("name", Named().name), identity, None, "sensors" not in data)

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
