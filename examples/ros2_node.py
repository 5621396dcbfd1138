"""ROS 2 node in the lock step, without ROS: it flies a square by positions; pip install zenoh-ros2-sdk.

    lapwing run groundstation --ros2 0 --set ros2.lock_step=true --set autopilot.estimator=ground_truth \
        --set run.duration=30 --speed max &
    python examples/ros2_node.py

It answers each pose with a position of the same time stamp. The run waits for the answer, so two flights are equal bit
for bit however fast this program is.
"""

import queue
import sys
import time

from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber
from zenoh_ros2_sdk.session import ZenohSession

DELAY = float(sys.argv[1]) if len(sys.argv) > 1 else 0.0  # [s] of thinking before each answer
PORT = int(sys.argv[2]) if len(sys.argv) > 2 else 7447  # of the router
CORNERS = [(0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (0.0, 3.0)]  # [m] world x, y
PATIENCE = 120.0  # [s] without a pose before the run counts as over
graph = {"domain_id": 0, "router_port": PORT}

poses: queue.SimpleQueue = queue.SimpleQueue()
subscriber = ROS2Subscriber("/drone1/pose", "geometry_msgs/msg/PoseStamped", callback=poses.put, **graph)
# The run begins when a node publishes a command: subscriptions come first.
arm = ROS2Publisher("/drone1/command/arm", "std_msgs/msg/Bool", **graph)
mode = ROS2Publisher("/drone1/command/mode", "std_msgs/msg/String", **graph)
target = ROS2Publisher("/drone1/command/pose", "geometry_msgs/msg/PoseStamped", **graph)

answered = 0
while True:
    try:
        pose = poses.get(timeout=20.0 if answered > 1 else PATIENCE)
    except queue.Empty:
        break
    time.sleep(DELAY)
    seconds = pose.header.stamp.sec
    if answered == 50:  # commands without a stamp take effect with the next answer
        mode.publish(data="offboard")
        arm.publish(data=True)
    wanted = pose.pose.position.__class__(*CORNERS[seconds // 5 % 4], 3.0)
    target.publish(header=pose.header, pose=pose.pose.__class__(wanted, pose.pose.orientation))
    answered += 1
print(f"{answered} answers", flush=True)
for entity in (subscriber, arm, mode, target):
    entity.close()
ZenohSession.get_instance().close()  # its threads would keep this program alive
