"""MAVLink for services: the dialect, frames of its fields, and mission items. pymavlink is imported here only."""
