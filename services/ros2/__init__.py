"""ROS 2 without ROS: topics and commands as rmw_zenoh has them, so that its nodes see the simulator as a node."""
