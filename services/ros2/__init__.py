"""ROS 2 node without a ROS installation: topics and commands with the keys and types of rmw_zenoh."""
