"""Flight modes by name."""

from lapwing.dynamics import discovery
from lapwing.services.autopilot.commander import modes
from lapwing.services.autopilot.commander.flight_mode import FlightMode

MODES: dict[str, type[FlightMode]] = {module.NAME: module.Mode for module in discovery.modules(modes).values()}
"""Mode class by name."""
