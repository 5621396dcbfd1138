"""The link of a real autopilot: MAVLink 2 on one side, the run's topics on the other; no other service uses MAVLink.

Foreign units and frames (NED, FRD, degrees, millimetres) end here.
"""
