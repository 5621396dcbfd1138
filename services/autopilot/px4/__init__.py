"""PX4's multicopter cascade as a control law, with PX4's gains: `[autopilot] controller = "px4"`.

Written from PX4's documentation (user guide, "Controller Diagrams" and "Parameter Reference") and from the papers that
the blocks cite. Gains are parameters that may change in flight.
"""
