"""Compiled plant of a scene, stepped for many start states and parameter sets at once by the batch executor."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from os import cpu_count
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.cosim.scene import Overrides, Scene, SceneError
from lapwing.dynamics import simd_batch
from lapwing.dynamics.effects._rotor_sums import total
from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.vehicles.multirotor_equations import StepInputs, evaluate, motion_of
from lapwing.kernels import kernel
from lapwing.kernels.row_packing import pack_row, row_width
from lapwing.services.common.schemas.communication_schema import Communication, Rates
from lapwing.services.common.schemas.vehicle_schema import Effects, airframe
from lapwing.services.plant.blocks.multirotor import MultirotorPlant
from lapwing.services.plant.resolve import resolve
from lapwing.services.plant.schema import Solver
from lapwing.services.scene_resolver import load_one

LONGEST_STEP = 0.01  # [s] largest integrator step
FORCE, TORQUE = "effects.body_wrench.force", "effects.body_wrench.torque"
LANES = simd_batch.WIDTH
MOTION = 13  # columns of position, attitude, velocity and omega


class PlantRows:
    """A scene's plant with one tick per sample of a recording.

    Attributes:
        interval: duration of a tick [s].
        rotors: number of rotors.
        motion: number of columns of the motion: position, attitude, velocity, omega, rotor speeds.
        rows: initial plant for each parameter set, shape (sets, columns).
        mass: mass for each parameter set [kg], shape (sets,).
        inertia: inertia for each parameter set [kg m^2], shape (sets, 3, 3).
    """

    def __init__(self, scene: Scene | str | Path, interval: float, overrides: Overrides = ()):
        """Resolve the scene, with one parameter set without values.

        Args:
            scene: path or name of a scene, or a loaded scene, whose model is a single rigid body.
            interval: time between two samples, the plant's tick [s].
            overrides: overrides of the scene, for all parameter sets.

        Raises:
            SceneError: the scene is invalid or of another model.
            ValueError: a second is not a whole number of intervals.
        """
        rate = round(1.0 / interval)
        if abs(rate * interval - 1.0) > 1e-6:
            raise ValueError(f"samples are {interval:g} s apart; expected a whole number of them in a second")
        steps = int(np.ceil(interval / LONGEST_STEP - 1e-9))
        self.interval = interval
        self._base = _with_wrench(load_one(scene, overrides))
        self._rate, self._step = rate, interval / steps
        first = _plant(self._scene({}))
        self._core = first.core
        self.example = simd_batch.member(first.core.vehicle, first.start.vehicle)
        self.motion = row_width(self.example.motion)
        self.rotors = len(self.example.voltage)
        self._pool = ThreadPoolExecutor(cpu_count())
        base = pack_row(self.example)
        perturbed = [self._row({FORCE: [1.0, 0.0, 0.0]}), self._row({TORQUE: [1.0, 0.0, 0.0]})]
        columns = [int(np.flatnonzero(row != base)[0]) for row in perturbed]
        self._force, self._torque = (slice(c, c + 3) for c in columns)
        self.set_parameters([{}])

    def set_parameters(self, sets: Sequence[Mapping[str, Any]]) -> None:
        """Resolve the scene once for each parameter set: values by dotted key."""
        plants = [self._build(values) for values in sets]
        self.rows = np.array([row for row, _, _ in plants])
        self.mass = np.array([mass for _, mass, _ in plants])
        self.inertia = np.array([inertia for _, _, inertia in plants])

    @property
    def speed_per_volt(self) -> float:
        """Steady rotor speed over motor voltage [rad/(s V)] of the first parameter set."""
        return float(self.example.parameters.layout.speed_per_volt)

    def start(self, sets: np.ndarray) -> np.ndarray:
        """Return blocks of initial vehicles for indices of parameter sets, shape (blocks, columns, lanes)."""
        count = -(-len(sets) // LANES) * LANES
        padded = np.concatenate([sets, np.full(count - len(sets), sets[-1] if len(sets) else 0)])
        return np.ascontiguousarray(self.rows[padded].reshape(-1, LANES, self.rows.shape[1]).transpose(0, 2, 1))

    def write(self, blocks: np.ndarray, columns: slice, values: np.ndarray) -> None:
        """Set columns of the first len(values) vehicles."""
        n = len(values)
        view = blocks[:, columns].transpose(0, 2, 1)
        if n == len(blocks) * LANES:
            view[:] = values.reshape(-1, LANES, values.shape[1])
            return
        whole = n // LANES
        view[:whole] = values[: whole * LANES].reshape(-1, LANES, values.shape[1])
        if n % LANES:
            view[whole, : n % LANES] = values[whole * LANES :]

    def read(self, blocks: np.ndarray, columns: slice, n: int) -> np.ndarray:
        """Return columns of the first n vehicles, shape (n, columns)."""
        return blocks[:, columns].transpose(0, 2, 1).reshape(-1, columns.stop - columns.start)[:n]

    def add_wrench(self, blocks: np.ndarray, force: np.ndarray, torque: np.ndarray) -> None:
        """Add constant forces [N] and torques [N m] in body axes, shape (n, 3) each."""
        n = len(force)
        self.write(blocks, self._force, self.read(blocks, self._force, n) + force)
        self.write(blocks, self._torque, self.read(blocks, self._torque, n) + torque)

    def advance(self, blocks: np.ndarray, voltage: np.ndarray) -> None:
        """Advance all vehicles by one tick under motor voltages [V], shape (n, rotors)."""
        self.advance_along(blocks, voltage[None])

    def advance_along(self, blocks: np.ndarray, voltage: np.ndarray, motions: np.ndarray | None = None) -> np.ndarray:
        """Advance all vehicles by several ticks; return motion and rotor speeds after each, shape (ticks, n, columns).

        Args:
            blocks: blocks from `start`, modified in place.
            voltage: motor voltages [V], shape (ticks, n, rotors).
            motions: position, attitude, velocity and omega to set before each tick, shape (ticks, n, 13).
        """
        ticks, n, _ = voltage.shape
        count = len(blocks) * LANES
        commands = _pad(voltage, count)
        reset = np.zeros((0, 0, 0)) if motions is None else _pad(motions, count)
        trace = np.empty((ticks, count, MOTION + self.rotors))
        flat, columns = blocks.reshape(-1), blocks.shape[1]
        keys, exchanges = np.zeros((count, 2), np.int64), np.zeros(count, np.int64)
        core = self._core
        parts = min(cpu_count() or 1, len(blocks))
        edges = [len(blocks) * k // parts for k in range(parts + 1)]

        def work(k: int) -> None:
            simd_batch.advance_along(
                core.method, self.example, flat, columns, keys, exchanges, commands, reset, trace, core.step,
                core.steps, edges[k], edges[k + 1],
            )  # fmt: skip

        if parts == 1:
            work(0)
        else:
            list(self._pool.map(work, range(parts)))
        return trace[:, :n]

    def power(self, blocks: np.ndarray, n: int) -> np.ndarray:
        """Return the electrical power [W] of the first n vehicles after their last tick, shape (n,)."""
        out = np.empty(len(blocks) * LANES)
        _electrical_power(self.example, blocks.reshape(-1), blocks.shape[1], out, 0, len(blocks))
        return out[:n]

    def _scene(self, values: Mapping[str, Any]) -> Scene:
        """Return the scene with all rates set to that of the recording."""
        scene = load_one(self._base, _complete_lists(self._base, values))
        rates = {name: self._rate for name in Rates.model_fields if getattr(scene[Rates], name) is not None}
        return (
            scene.replaced(scene[Communication].model_copy(update={"rate": self._rate}))
            .replaced(scene[Solver].model_copy(update={"step": self._step}))
            .replaced(Rates(**rates))
        )

    def _row(self, values: Mapping[str, Any]) -> np.ndarray:
        return self._build(values)[0]

    def _build(self, values: Mapping[str, Any]) -> tuple[np.ndarray, float, np.ndarray]:
        scene = self._scene(values)
        plant = _plant(scene)
        member = simd_batch.member(plant.core.vehicle, plant.start.vehicle)
        if [type(e) for e in plant.core.vehicle.effects] != [type(e) for e in self._core.vehicle.effects]:
            raise SceneError("effects", "a parameter set has other effects than the scene", "the same effects")
        mass = airframe(scene).mass
        return pack_row(member), mass.total, mass.matrix


@kernel
def _electrical_power(example: Any, memory: Any, columns: int, out: Any, first: int, last: int) -> None:
    """Write the power [W] of the motors of each member at its last voltages.

    Args:
        example: prototype, a Member of `lapwing.dynamics.simd_batch`.
        memory: blocks of the batch, flat.
        columns: number of columns of a block.
        out: result, shape (members,).
        first: first block.
        last: block after the last.
    """
    for m in range(first * LANES, last * LANES):
        x = simd_batch.take(example, memory, (m // LANES) * columns * LANES + m % LANES)
        u = StepInputs(x.parameters, x.body, x.memory, x.voltage)
        _, rotors, _, _ = evaluate(u, x.start, motion_of(x.parameters.layout, x.motion))
        out[m] = total(rotors.power)


def _pad(values: np.ndarray, count: int) -> np.ndarray:
    """Return values of shape (ticks, n, columns) with the last vehicle repeated up to `count` vehicles."""
    if values.shape[1] == count:
        return np.ascontiguousarray(values)
    return np.concatenate([values, np.repeat(values[:, -1:], count - values.shape[1], axis=1)], axis=1)


def _with_wrench(scene: Scene) -> Scene:
    """Return the scene with an effect `body_wrench`, for the trim."""
    if "body_wrench" in scene[Effects].tables:
        return scene
    return load_one(scene, {FORCE: [0.0, 0.0, 0.0]})


def _complete_lists(scene: Scene, values: Mapping[str, Any]) -> dict[str, Any]:
    """Replace elements of an airframe's list, which its file may omit, by the entire list."""
    out: dict[str, Any] = {}
    for key, value in values.items():
        prefix, _, element = key.rpartition(".")
        if not (element.isdigit() and key.startswith("airframe.")):
            out[key] = value
            continue
        if prefix not in out:
            out[prefix] = scene.lookup(prefix)
        result = list(out[prefix])
        result[int(element)] = value
        out[prefix] = result
    return out


def _plant(scene: Scene) -> Any:
    with scene.located():
        plant = resolve(scene).parameters
    if not isinstance(plant.core, MultirotorPlant) or not isinstance(plant.start.vehicle.motion, Motion):
        raise SceneError("vehicle.model", f"got {plant.model!r}", "the model of a single rigid body")
    return plant
