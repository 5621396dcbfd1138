"""Commands of plans (MAV_CMD): names, and what becomes of those that are not flown.

Names are MAVLink's without MAV_CMD. A command is skipped only if the vehicle's path is the same without it.
"""

FLOWN = {
    16: "NAV_WAYPOINT",
    17: "NAV_LOITER_UNLIM",
    18: "NAV_LOITER_TURNS",
    19: "NAV_LOITER_TIME",
    20: "NAV_RETURN_TO_LAUNCH",
    21: "NAV_LAND",
    22: "NAV_TAKEOFF",
    31: "NAV_LOITER_TO_ALT",
    34: "DO_ORBIT",
    80: "NAV_ROI",
    82: "NAV_SPLINE_WAYPOINT",
    93: "NAV_DELAY",
    112: "CONDITION_DELAY",
    114: "CONDITION_DISTANCE",
    115: "CONDITION_YAW",
    177: "DO_JUMP",
    178: "DO_CHANGE_SPEED",
    179: "DO_SET_HOME",
    195: "DO_SET_ROI_LOCATION",
    197: "DO_SET_ROI_NONE",
    201: "DO_SET_ROI",
    211: "DO_GRIPPER",
    5001: "NAV_FENCE_POLYGON_VERTEX_INCLUSION",
    5002: "NAV_FENCE_POLYGON_VERTEX_EXCLUSION",
    5003: "NAV_FENCE_CIRCLE_INCLUSION",
    5004: "NAV_FENCE_CIRCLE_EXCLUSION",
    5100: "NAV_RALLY_POINT",
}

_CAMERA = "the vehicle has no camera"
_GIMBAL = "the vehicle has no gimbal"
_OUTPUT = "the vehicle has no such output"
_MARK = "it marks a place in the mission"
SKIPPED = {  # name, and the reason why the path is the same without it
    181: ("DO_SET_RELAY", _OUTPUT),
    182: ("DO_REPEAT_RELAY", _OUTPUT),
    183: ("DO_SET_SERVO", _OUTPUT),
    184: ("DO_REPEAT_SERVO", _OUTPUT),
    187: ("DO_SET_ACTUATOR", _OUTPUT),
    188: ("DO_RETURN_PATH_START", _MARK),
    189: ("DO_LAND_START", _MARK),
    196: ("DO_SET_ROI_WPNEXT_OFFSET", "the heading stays that of the waypoints"),
    198: ("DO_SET_ROI_SYSID", "the heading stays that of the waypoints"),
    200: ("DO_CONTROL_VIDEO", _CAMERA),
    202: ("DO_DIGICAM_CONFIGURE", _CAMERA),
    203: ("DO_DIGICAM_CONTROL", _CAMERA),
    204: ("DO_MOUNT_CONFIGURE", _GIMBAL),
    205: ("DO_MOUNT_CONTROL", _GIMBAL),
    206: ("DO_SET_CAM_TRIGG_DIST", _CAMERA),
    207: ("DO_FENCE_ENABLE", "the geofence is always enabled"),
    208: ("DO_PARACHUTE", "the vehicle has no parachute"),
    214: ("DO_SET_CAM_TRIGG_INTERVAL", _CAMERA),
    215: ("DO_SET_RESUME_REPEAT_DIST", "a mission resumes where it was left"),
    216: ("DO_SPRAYER", _OUTPUT),
    220: ("DO_MOUNT_CONTROL_QUAT", _GIMBAL),
    260: ("OBLIQUE_SURVEY", _CAMERA),
    405: ("ILLUMINATOR_ON_OFF", "the vehicle has no light"),
    530: ("SET_CAMERA_MODE", _CAMERA),
    531: ("SET_CAMERA_ZOOM", _CAMERA),
    532: ("SET_CAMERA_FOCUS", _CAMERA),
    534: ("SET_CAMERA_SOURCE", _CAMERA),
    600: ("JUMP_TAG", _MARK),
    1000: ("DO_GIMBAL_MANAGER_PITCHYAW", _GIMBAL),
    1001: ("DO_GIMBAL_MANAGER_CONFIGURE", _GIMBAL),
    2000: ("IMAGE_START_CAPTURE", _CAMERA),
    2001: ("IMAGE_STOP_CAPTURE", _CAMERA),
    2003: ("DO_TRIGGER_CONTROL", _CAMERA),
    2004: ("CAMERA_TRACK_POINT", _CAMERA),
    2005: ("CAMERA_TRACK_RECTANGLE", _CAMERA),
    2010: ("CAMERA_STOP_TRACKING", _CAMERA),
    2500: ("VIDEO_START_CAPTURE", _CAMERA),
    2501: ("VIDEO_STOP_CAPTURE", _CAMERA),
    2510: ("LOGGING_START", "the log covers the entire run"),
    2511: ("LOGGING_STOP", "the log covers the entire run"),
    2800: ("PANORAMA_CREATE", _CAMERA),
    4501: ("CONDITION_GATE", "the vehicle flies to the next waypoint"),
    42600: ("DO_WINCH", "the vehicle has no winch"),
}

_VTOL = "not for multirotors"
_REMOTE = "a command of an operator, not of a mission; remove it"
_OTHER = "no such manoeuvre; use NAV_WAYPOINT"
REFUSED = {  # name, reason and what to do
    23: ("NAV_LAND_LOCAL", "positions in a local frame are not flown; use NAV_LAND"),
    24: ("NAV_TAKEOFF_LOCAL", "positions in a local frame are not flown; use NAV_TAKEOFF"),
    25: ("NAV_FOLLOW", _OTHER),
    30: ("NAV_CONTINUE_AND_CHANGE_ALT", "not for multirotors; use NAV_LOITER_TO_ALT"),
    32: ("DO_FOLLOW", _OTHER),
    33: ("DO_FOLLOW_REPOSITION", _OTHER),
    35: ("DO_FIGURE_EIGHT", _OTHER),
    36: ("NAV_ARC_WAYPOINT", "arcs are not flown; use waypoints along the arc"),
    81: ("NAV_PATHPLANNING", _OTHER),
    83: ("NAV_ALTITUDE_WAIT", "not for multirotors; remove it"),
    84: ("NAV_VTOL_TAKEOFF", f"{_VTOL}; use NAV_TAKEOFF"),
    85: ("NAV_VTOL_LAND", f"{_VTOL}; use NAV_LAND"),
    92: ("NAV_GUIDED_ENABLE", "no external computer takes over in a mission; use setpoints in offboard mode"),
    94: ("NAV_PAYLOAD_PLACE", "not flown; use NAV_LAND and DO_GRIPPER"),
    113: ("CONDITION_CHANGE_ALT", "not flown; use NAV_LOITER_TO_ALT"),
    176: ("DO_SET_MODE", _REMOTE),
    180: ("DO_SET_PARAMETER", _REMOTE),
    185: ("DO_FLIGHTTERMINATION", _REMOTE),
    186: ("DO_CHANGE_ALTITUDE", "not flown; use NAV_LOITER_TO_ALT"),
    190: ("DO_RALLY_LAND", "not flown; use NAV_RETURN_TO_LAUNCH"),
    191: ("DO_GO_AROUND", _VTOL + "; remove it"),
    192: ("DO_REPOSITION", "a command of an operator, not of a mission; use NAV_WAYPOINT"),
    193: ("DO_PAUSE_CONTINUE", _REMOTE),
    194: ("DO_SET_REVERSE", "not for multirotors; remove it"),
    209: ("DO_MOTOR_TEST", _REMOTE),
    210: ("DO_INVERTED_FLIGHT", "not for multirotors; remove it"),
    212: ("DO_AUTOTUNE_ENABLE", "not for multirotors; remove it"),
    213: ("NAV_SET_YAW_SPEED", "not flown; use CONDITION_YAW and DO_CHANGE_SPEED"),
    217: ("DO_SEND_SCRIPT_MESSAGE", "the autopilot runs no scripts; remove it"),
    218: ("DO_AUX_FUNCTION", "the vehicle has no auxiliary switches; remove it"),
    221: ("DO_GUIDED_MASTER", _REMOTE),
    222: ("DO_GUIDED_LIMITS", "no external computer takes over in a mission; remove it"),
    223: ("DO_ENGINE_CONTROL", "not for electric motors; remove it"),
    224: ("DO_SET_MISSION_CURRENT", "a command of an operator, not of a mission; use DO_JUMP"),
    300: ("MISSION_START", _REMOTE),
    400: ("COMPONENT_ARM_DISARM", _REMOTE),
    601: ("DO_JUMP_TAG", "not flown; use DO_JUMP"),
    3000: ("DO_VTOL_TRANSITION", f"{_VTOL}; remove it"),
    5000: ("NAV_FENCE_RETURN_POINT", "a return goes home or to a rally point; use NAV_RALLY_POINT"),
    5005: ("NAV_FENCE_HOME_CIRCLE_INCLUSION", "not supported; use NAV_FENCE_CIRCLE_INCLUSION"),
    30001: ("PAYLOAD_PREPARE_DEPLOY", "not flown; use NAV_WAYPOINT and DO_GRIPPER"),
    30002: ("PAYLOAD_CONTROL_DEPLOY", "not flown; use DO_GRIPPER"),
    42007: ("SET_EKF_SOURCE_SET", "the estimator has one set of sources; remove it"),
    42702: ("NAV_SCRIPT_TIME", "the autopilot runs no scripts; remove it"),
    42703: ("NAV_ATTITUDE_TIME", "attitudes are not flown in a mission; use setpoints in offboard mode"),
}
REFUSED |= {31000 + k: (f"WAYPOINT_USER_{k + 1}", "it has no meaning here; use NAV_WAYPOINT") for k in range(5)}
REFUSED |= {31005 + k: (f"SPATIAL_USER_{k + 1}", "it has no meaning here; remove it") for k in range(5)}
REFUSED |= {31010 + k: (f"USER_{k + 1}", "it has no meaning here; remove it") for k in range(5)}


def name(command: int) -> str:
    """Return the name of a command, or its number if it is unknown."""
    if command in FLOWN:
        return FLOWN[command]
    known = SKIPPED.get(command) or REFUSED.get(command)
    return known[0] if known else f"command {command}"
