"""A recorded flight on a uniform time grid, in SI units, world ENU and body FLU."""

from dataclasses import dataclass, field

import numpy as np

LONGEST_GAP = 0.035  # [s] between two samples that interpolation bridges
GYRO_LIMIT = 35.0  # [rad/s] range of the usual gyroscopes, 2000 deg/s
LARGEST_STEP = 12.0  # times the median absolute step of a channel above which a sample is an outlier


@dataclass(frozen=True)
class Recording:
    """One flight of one vehicle; n samples.

    Attributes:
        name: of the flight, the file's name without its endings.
        interval: [s] between two samples.
        position: [m] world, shape (n, 3).
        attitude: unit quaternions w, x, y, z, body to world, shape (n, 4).
        velocity: [m/s] world, shape (n, 3).
        omega: [rad/s] body, shape (n, 3).
        specific_force: [m/s^2] body, shape (n, 3); NaN where not measured.
        motor_voltage: [V] applied to each motor, shape (n, rotors).
        battery_voltage: [V], shape (n,).
        valid: samples that every channel measured soundly, bool, shape (n,).
        power: [W] taken from the battery, shape (n,); NaN where not measured.
        faults: number of samples marked invalid by cause.
        notes: time offset and other facts of the import, a line each.
    """

    name: str
    interval: float
    position: np.ndarray
    attitude: np.ndarray
    velocity: np.ndarray
    omega: np.ndarray
    specific_force: np.ndarray
    motor_voltage: np.ndarray
    battery_voltage: np.ndarray
    valid: np.ndarray
    power: np.ndarray = field(default_factory=lambda: np.empty(0))
    faults: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.valid)

    @property
    def rotors(self) -> int:
        """Number of rotors."""
        return int(self.motor_voltage.shape[1])


def widen(invalid: np.ndarray, samples: int) -> np.ndarray:
    """Return the mask with `samples` neighbours on either side of each marked sample marked too."""
    return np.convolve(invalid, np.ones(2 * samples + 1), "same") > 0.5
