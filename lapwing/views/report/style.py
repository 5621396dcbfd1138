"""Colours and sizes of all plots, in a browser and on paper."""

STEERED = ("rigid_body", "multibody", "slung_load")  # vehicle models with an autopilot

WIDTH = 10.0  # [inch] of all figures; 100 pixels per inch on the page
DPI = 125
POINTS = 1000  # largest number in a line: extremes at every second pixel of the page

# Palette of Okabe and Ito, which is safe for colour-blind readers.
FLOWN = "#0072B2"
REFERENCE = "#333333"
BOUND = "#D55E00"
AXIS_COLOURS = ("#0072B2", "#E69F00", "#009E73")
COLOURS = (*AXIS_COLOURS, "#CC79A7", "#56B4E9", "#882255", "#999933", "#666666")  # motors, vehicles
SHADE = "#F1F3F5"
QUIET = "#9AA5AF"
TEXT = "#333333"

# Colours on a dark background by those on a light one; all others are legible on both.
DARK = {
    "#FFFFFF": "#1D232A",
    TEXT: "#D6DCE2",  # same as REFERENCE
    "#222222": "#F0F3F6",
    "#555555": "#A9B3BD",
    "#666666": "#8F99A3",
    "#888888": "#7A848E",
    "#E3E7EA": "#2B333B",  # grid
    "#C5CBD0": "#4A545E",  # zero lines
    SHADE: "#1C2228",
    "#0072B2": "#4AA3DF",
    "#D55E00": "#F08A4B",
    "#009E73": "#2FBF93",
    "#56B4E9": "#A8DDFA",
    "#882255": "#D9739F",
    "#7A5200": "#C99A45",
    "#7B3F61": "#C98AB0",
}
