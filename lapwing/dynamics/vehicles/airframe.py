"""Airframe from its TOML file: the numbers of a vehicle that do not depend on the scene."""

import math
import tomllib
from pathlib import Path

import numpy as np
from pydantic import Field, model_validator

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._types import steiner
from lapwing.dynamics.input_file import read_text, unreadable
from lapwing.dynamics.validation import validated
from lapwing.dynamics.vehicles.airframe_tables import (
    Battery,
    CarriedBox,
    Contact,
    Drag,
    Mass,
    Motor,
    Posterior,
    Propeller,
    Published,
    RotorPlacement,
    Section,
    Triple,
)
from lapwing.kernels.math import dist

LEAST_GYRATION = 0.02  # limits of the radius of gyration over the distance to the rotors; real vehicles have 0.3 to 0.6


class Airframe(Section):
    """Multirotor airframe; missing parts are None, and effects that need them are rejected."""

    mesh: str | None = None  # STL, OBJ or glTF file in metres next to this one, for the 3D view
    mass: Mass
    rotors: RotorPlacement
    motor: Motor
    propeller: Propeller | None = None
    battery: Battery | None = None
    contact: Contact | None = None
    drag: Drag | None = None
    payload: CarriedBox | None = None
    published: Published | None = None
    posterior: Posterior | None = Field(default=None, exclude=True)  # for campaigns, not part of a flight

    @model_validator(mode="after")
    def _one_payload(self) -> "Airframe":
        if self.payload and self.mass.payload:
            message = f"got {self.mass.payload:g} together with a table [payload], which [mass] does not include"
            raise ConfigError("mass.payload", message, "0")
        return self

    @model_validator(mode="after")
    def _expand(self) -> "Airframe":
        gyration = math.sqrt(min(self.mass.inertia) / self.mass.total)
        reach = max(dist(self.mass.centre, place) for place in self.rotors.position)
        if gyration < LEAST_GYRATION * reach:
            actual = (
                f"got {list(self.mass.inertia)} with {self.mass.total:g} kg: a radius of gyration of {gyration:.2g} m"
            )
            expected = f"at least {LEAST_GYRATION * reach:.2g} m, a fiftieth of the distance to the rotors; in kg m^2"
            raise ConfigError("mass.inertia", actual, expected)
        return self

    @property
    def motor_current_limit(self) -> float:
        """Current limit of one motor [A]: that of its controller, or its share of the battery's C rating."""
        pack = self.battery.current_limit if self.battery else math.inf
        return min(self.motor.current_limit, pack / len(self.rotors.position))

    @property
    def loaded(self) -> "Airframe":
        """Airframe with the box of [payload] included in its mass (theory, eq. (2.41))."""
        box, own = self.payload, self.mass
        if box is None or own.payload:
            return self
        total = own.total + box.mass
        centre = (own.total * np.array(own.centre) + box.mass * np.array(box.position)) / total
        inertia = own.matrix + steiner(own.total, own.centre - centre)
        inertia += box.inertia + steiner(box.mass, box.position - centre)
        joint = own.model_copy(
            update={
                "total": total,
                "payload": box.mass,
                "inertia": tuple(np.diag(inertia).tolist()),
                "products": (float(inertia[0, 1]), float(inertia[0, 2]), float(inertia[1, 2])),
                "centre": tuple(centre.tolist()),
            }
        )
        return self.model_copy(update={"mass": joint})

    @property
    def about_centre(self) -> "Airframe":
        """Airframe with every position relative to the centre of mass."""
        if not any(self.mass.centre):
            return self
        x, y, z = self.mass.centre

        def moved(places: tuple[Triple, ...]) -> tuple[Triple, ...]:
            return tuple((a - x, b - y, c - z) for a, b, c in places)

        mass = self.mass.model_copy(update={"centre": (0.0, 0.0, 0.0)})
        rotors = self.rotors.model_copy(update={"position": moved(self.rotors.position)})
        contact = self.contact and self.contact.model_copy(
            update={"feet": moved(self.contact.feet), "hull": moved(self.contact.hull)}
        )
        payload = self.payload and self.payload.model_copy(update={"position": moved((self.payload.position,))[0]})
        return self.model_copy(update={"mass": mass, "rotors": rotors, "contact": contact, "payload": payload})


def load_airframe(path: str | Path) -> Airframe:
    """Read an airframe from a TOML file.

    Raises:
        ValueError: one line with the file, the key and the expected value.
    """
    path = Path(path)
    try:
        return validated(Airframe.model_validate, tomllib.loads(read_text(path)), Airframe)
    except OSError as error:
        raise unreadable(path, error, "an airframe file (.toml)") from None
    except ConfigError as error:
        raise ValueError(f"{path}: {error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not valid TOML: {error}") from None
