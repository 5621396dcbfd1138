"""Places in a scene: in metres, or by latitude and longitude."""

from contextlib import suppress
from typing import Annotated, Any

from pydantic import ConfigDict, Field

from lapwing.cosim.scene.files import unvalidated_value
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.geodesy import Home, geodetic_to_enu
from lapwing.dynamics.validation import Table, validated
from lapwing.kernels import python_function


class PlaceTable(Table):
    """A place as a table: in metres or on the Earth."""

    model_config = ConfigDict(strict=False)

    x: float | None = None  # [m] along world x (east), of a waypoint from the start
    y: float | None = None  # [m] along world y (north)
    latitude_deg: Annotated[float, Field(ge=-90.0, le=90.0)] | None = None  # [deg] with longitude_deg, instead of x, y
    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0)] | None = None  # [deg] east

    def east_north(self, home: Home, start: tuple[float, float], z: float) -> tuple[float, float]:
        """Return x and y [m] from the start.

        Args:
            home: origin of the world frame.
            start: world x and y of the start [m].
            z: height above home [m].

        Raises:
            ConfigError: the place is missing, or given twice.
        """
        pairs = [(self.x, self.y), (self.latitude_deg, self.longitude_deg)]
        given = [pair for pair in pairs if pair != (None, None)]
        if len(given) != 1 or None in given[0]:
            names = ", ".join(sorted(self.model_fields_set)) or "nothing"
            raise ConfigError("", f"got {names}", "x and y, or latitude_deg and longitude_deg")
        if self.x is not None and self.y is not None:
            return self.x, self.y
        x, y, _ = python_function(geodetic_to_enu)(home, self.latitude_deg, self.longitude_deg, home.height + z)
        return x - start[0], y - start[1]


def home_of(tree: dict[str, Any]) -> Home:
    """Return the home of a scene that is not validated yet; an invalid one is reported when its table is validated."""
    with suppress(TypeError):
        return Home(**unvalidated_value(tree, "environment", "home") or {})
    return Home()


def world_place(tree: dict[str, Any], key: str, place: Any) -> Any:
    """Return world x and y [m] of a place that may be a table. Raise ConfigError with its key in the scene."""
    if not isinstance(place, dict):
        return place
    try:
        return list(validated(PlaceTable.model_validate, place, PlaceTable).east_north(home_of(tree), (0.0, 0.0), 0.0))
    except ConfigError as error:
        raise error.with_prefix(key) from None
