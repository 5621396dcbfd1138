"""The `[ros2]` table of a scene."""

from typing import ClassVar

from pydantic import Field

from lapwing.cosim.scene import SceneTable


class Ros2(SceneTable):
    """Publication of a multi-process run to nodes of a ROS 2 graph that use rmw_zenoh."""

    TABLE: ClassVar[str] = "ros2"
    SHARED: ClassVar[bool] = True
    OPTIONAL: ClassVar[bool] = True
    enabled: bool = False  # publish for ROS 2 nodes, as the option --ros2 does
    domain_id: int = Field(default=0, ge=0, le=232)  # ROS_DOMAIN_ID of the nodes
    lock_step: bool = False  # the run waits, at each tick of rates.commands, for the command that a node stamps with it
