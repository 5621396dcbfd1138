"""Plans of ground stations: one conversion of their items to the autopilot's, for files and for MAVLink.

`plan_file`, `qgc_plan` and `waypoints_file` read files; `services/mavlink/mission_store.py` reads messages. Both make
`PlanItem`s, which `converter.convert` turns into a route, or refuses with number, name and reason. The autopilot
checks every route that reaches it with `route_checks`, also those of ROS 2, whose items are the autopilot's own.
"""
