"""MAVLink 2 link between the run's topics and ground stations, as of a real autopilot.

MAVLink's units and frames (NED, FRD, degrees, millimetres) are converted here from and to SI, ENU and FLU.
"""
