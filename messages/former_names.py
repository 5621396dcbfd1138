"""Former names of topics, message types and fields, so that logs of earlier versions can be read.

A renamed topic, type or field is entered here; its layout must not have changed.
"""

from lapwing.messages.parse import Definition

_TOPICS = {  # current name by former name, without the vehicle's, and current type
    ("truth", "lapwing_msgs/msg/VehicleState"): "ground_truth",
    ("bodies", "lapwing_msgs/msg/BodyStates"): "body_states",
    ("contact", "lapwing_msgs/msg/ContactForces"): "contact_forces",
    ("lift", "lapwing_msgs/msg/RotorWrench"): "rotor_wrench",
    ("operator", "lapwing_msgs/msg/OperatorInput"): "vehicle_command",
    ("answers", "lapwing_msgs/msg/CommandAcks"): "vehicle_command_ack",
    ("airspeed", "sensor_msgs/msg/FluidPressure"): "differential_pressure",
    ("airspeed/received", "sensor_msgs/msg/FluidPressure"): "differential_pressure/received",
}
_CUSTOM_SENSOR = "own_sensor/", "custom_sensor/"
_TYPES = {"lapwing_msgs/msg/LiftCommand": "lapwing_msgs/msg/RotorWrench"}
_FIELDS = {
    "lapwing_msgs/msg/Status": {"prearm": "arming_blockers", "offboard_fresh": "offboard_available"},
    "lapwing_msgs/msg/Estimate": {"rejected": "rejected_sources", "health": "health_flags"},
    "lapwing_msgs/msg/MissionItem": {"hold": "hold_time"},
    "lapwing_msgs/msg/CommandAcks": {"answers": "acks"},
}


def current_type(name: str) -> str:
    """Return the current name of a message type, "lapwing_msgs/msg/RotorWrench"."""
    return _TYPES.get(name, name)


def current_topic(name: str, type_name: str) -> str:
    """Return the current name of a recorded topic, "/drone1/ground_truth", whose type has a current name."""
    head, _, rest = name.removeprefix("/").partition("/")
    former, current = _CUSTOM_SENSOR
    if rest.startswith(former) and type_name == "lapwing_msgs/msg/Reading":
        return f"/{head}/{current}{rest.removeprefix(former)}"
    return f"/{head}/{_TOPICS[rest, type_name]}" if (rest, type_name) in _TOPICS else name


def with_current_fields(definition: Definition) -> Definition:
    """Return the definition of a recorded message type with the current names of its fields."""
    names = _FIELDS.get(definition.type_name, {})
    return definition._replace(fields=tuple(f._replace(name=names.get(f.name, f.name)) for f in definition.fields))


def current_fields(class_path: str, members: dict) -> dict:
    """Return the members of a serialised message with the current names of its fields.

    Args:
        class_path: path of the class, "lapwing.messages.types:MissionItem".
        members: values by recorded name.
    """
    module, _, name = class_path.partition(":")
    names = _FIELDS.get(f"lapwing_msgs/msg/{name}", {}) if module == "lapwing.messages.types" else {}
    return {names.get(key, key): value for key, value in members.items()}
