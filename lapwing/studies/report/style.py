"""Colours and sizes of every plot, in a browser and on paper."""

STEERED = ("rigid_body", "multibody", "slung_load")  # the models of vehicles that an autopilot flies

WIDTH = 10.0  # [inch] of every figure; the page shows 100 pixels an inch
DPI = 125
POINTS = 1000  # of a line at most: extremes at every second pixel of the page

# Okabe and Ito's palette: told apart also without red-green vision.
FLOWN = "#0072B2"
REFERENCE = "#333333"
BOUND = "#D55E00"
AXIS_COLOURS = ("#0072B2", "#E69F00", "#009E73")
COLOURS = (*AXIS_COLOURS, "#CC79A7", "#56B4E9", "#882255", "#999933", "#666666")  # motors, vehicles
SHADE = "#F1F3F5"
QUIET = "#9AA5AF"
