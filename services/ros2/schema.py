"""The `[bus]` of a scene: who else may hear it."""

from typing import ClassVar

from pydantic import Field

from lapwing.cosim.scene import SceneTable


class Bus(SceneTable):
    """Whether a run in processes is a node of a ROS 2 graph, too."""

    TABLE: ClassVar[str] = "bus"
    SHARED: ClassVar[bool] = True
    OPTIONAL: ClassVar[bool] = True
    ros2: bool = False  # publish for nodes that use rmw_zenoh, as --ros2 does
    ros2_domain: int = Field(default=0, ge=0, le=232)  # their ROS_DOMAIN_ID
