"""The scenes that ship, found by name; airframes in `vehicles/`, flight plans in `plans/`."""
