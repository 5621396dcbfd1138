"""Many vehicles of a scene stepped together, with numpy arrays."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from os import cpu_count
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lapwing.cosim.scene import Overrides, Scene, SceneError
from lapwing.dynamics import simd_batch
from lapwing.dynamics.effects._types import Motion
from lapwing.kernels.row_packing import pack_row, row_width
from lapwing.services.autopilot import controller_parameters
from lapwing.services.autopilot.controller_parameters import Airframe
from lapwing.services.autopilot.motor import RPM
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.common.vehicle_schema import Vehicle
from lapwing.services.plant.blocks.multirotor import MultirotorPlant
from lapwing.services.plant.models._common import noise_key
from lapwing.services.plant.service_config import PlantSetup
from lapwing.services.scene_resolver import load, load_one, resolve
from lapwing.studies.campaign.distributions import Distribution
from lapwing.studies.campaign.plan import plan

RATE_BANDWIDTH = 15.0  # [rad/s] with which body rates are followed
OMEGA = slice(10, 13)  # columns of a motion


class BatchState(NamedTuple):
    """The states of n vehicles as arrays; world ENU, body FLU."""

    time: np.ndarray  # [s] of each since its reset, shape (n,)
    position_world: np.ndarray  # [m], shape (n, 3)
    attitude: np.ndarray  # unit quaternions w, x, y, z, body to world, shape (n, 4)
    velocity_world: np.ndarray  # [m/s], shape (n, 3)
    omega_body: np.ndarray  # [rad/s], shape (n, 3)
    rotor_speed: np.ndarray  # [rad/s], shape (n, rotors)


class BatchSimulator:
    """n vehicles of a scene, without sensors and autopilot, stepped together.

    ```python
    batch = BatchSimulator("hover", 4096, vary={"vehicle.mass": lapwing.normal(10.4, 0.2)})
    state = batch.step(motor_voltages=np.full((4096, 4), 33.5))
    state = batch.step(thrust=np.full(4096, 102.0), body_rates=np.zeros((4096, 3)), ticks=5)
    batch.reset([3, 17], position_world=(0.0, 0.0, 5.0))
    ```

    Under motor voltages every member has the bits of one vehicle alone; it is the plant of `lapwing.fly`.
    """

    def __init__(
        self,
        scene: Scene | str | Path,
        n: int,
        vary: Mapping[str, Distribution] | None = None,
        overrides: Overrides = (),
        *,
        seed: int = 1,
    ):
        """n vehicles at rest where the scene puts them.

        Args:
            scene: what to simulate: a path, a name, or a loaded one; its model is "rigid_body".
            n: how many.
            vary: how keys of the scene vary from member to member; member k draws what run k of a campaign draws. Each
                costs the resolving of a scene, about 6 ms.
            overrides: as of `lapwing.load_scene`.
            seed: of the draws, and of the members' randomness.

        Raises:
            SceneError: the scene is not sound, or has another model.
            ValueError: n is below 1, or members would differ in more than numbers.
        """
        if n < 1:
            raise ValueError(f"n: expected at least 1 member, got {n}")
        base = load_one(scene, overrides)
        drawn = plan(base.name, (), n, seed, vary)
        first = _plant(load(base, drawn.given(0)))
        self._core, self.n, self.interval = first.core, n, first.core.interval
        self._like = simd_batch.member(first.core.vehicle, first.start.vehicle)
        self._motion = row_width(self._like.motion)
        self._blocks = simd_batch.blocks(n, self._like)
        members = len(self._blocks) * simd_batch.WIDTH  # those beyond n fill the last block
        name = base[Vehicle].name
        self._keys = np.array([noise_key(drawn.seed_of(min(k, n - 1)), name) for k in range(members)], np.int64)
        self._ticks = np.zeros(members, np.int64)
        self._fresh = np.empty((members, row_width(self._like)))  # rows of the members before their first step
        self._fresh[:] = pack_row(self._like)
        for k in range(1, n) if drawn.keys else ():
            plant = _plant(load(base, drawn.given(k)))
            if _kinds(plant.core) != _kinds(first.core):
                raise ValueError(f"member {k}: has other effects or another solver than member 0")
            self._fresh[k] = pack_row(simd_batch.member(plant.core.vehicle, plant.start.vehicle))
        self._place(np.arange(members))
        self._pool = ThreadPoolExecutor(cpu_count())
        self._scene = base

    @property
    def weight(self) -> float:
        """Weight of the nominal vehicle [N]."""
        return self._steered.mass * self._steered.gravity

    @property
    def hover_speed(self) -> np.ndarray:
        """Speed of each rotor [rad/s] at which all carry equal parts of the nominal weight; shape (rotors,)."""
        thrust = self.weight / controller_parameters.lift(self._steered)
        return np.full(len(self._like.voltage), np.sqrt(thrust / self._steered.motor.thrust_coefficient))

    @property
    def state(self) -> BatchState:
        """The present states, copied."""
        rows = self._rows(self._motion)[: self.n]
        parts, at = [], 0
        for part in self._like.motion:
            parts.append(rows[:, at : at + len(part)].copy())
            at += len(part)
        return BatchState(self._ticks[: self.n] * self.interval, *parts)

    def step(
        self,
        motor_voltages: ArrayLike | None = None,
        thrust: ArrayLike | None = None,
        body_rates: ArrayLike | None = None,
        ticks: int = 1,
    ) -> BatchState:
        """Go on for some ticks under one command.

        Args:
            motor_voltages: [V] of each motor, shape (n, rotors); or
            thrust: [N] of all rotors together, shape (n,), with
            body_rates: [rad/s] to be followed, shape (n, 3): by a proportional controller of 15 rad/s at every tick,
                on the nominal airframe.
            ticks: how many; one is `interval` seconds.

        Raises:
            ValueError: another command, shape, or number that is not finite.
        """
        if (motor_voltages is None) == (thrust is None) or (thrust is None) != (body_rates is None):
            raise ValueError("step: expected motor_voltages, or thrust and body_rates")
        if not isinstance(ticks, int) or ticks < 1:
            raise ValueError(f"step: expected ticks = 1, 2, ..., got {ticks!r}")
        if motor_voltages is not None:
            self._advance(_sound("motor_voltages", motor_voltages, (self.n, len(self._like.voltage))), ticks)
        else:
            wanted = _sound("thrust", thrust, (self.n,)), _sound("body_rates", body_rates, (self.n, 3))
            for _ in range(ticks):
                self._advance(self._voltages(*wanted), 1)
        return self.state

    def reset(self, members: Sequence[int] | np.ndarray | None = None, **state: ArrayLike) -> BatchState:
        """Begin anew: the same vehicles under the same random numbers, at the scene's start or in another state.

        Args:
            members: which; None: all.
            state: fields of `BatchState` but the time, one value for all or one for each of the members.

        Raises:
            ValueError: no such member or field, or another shape.
        """
        chosen = np.arange(self.n) if members is None else np.atleast_1d(np.asarray(members))
        if chosen.dtype == bool:
            chosen = np.flatnonzero(chosen)
        if chosen.size and not (chosen.dtype.kind in "iu" and chosen.min() >= 0 and chosen.max() < self.n):
            raise ValueError(f"members: expected numbers from 0 to {self.n - 1}")
        self._place(chosen)
        at = 0
        for name, part in zip(Motion._fields, self._like.motion, strict=True):
            if name in state:
                shape, given = (len(chosen), len(part)), state.pop(name)
                value = _sound(name, np.broadcast_to(given, shape) if np.ndim(given) == 1 else given, shape)
                for k in range(len(part)):
                    self._blocks[chosen // simd_batch.WIDTH, at + k, chosen % simd_batch.WIDTH] = value[:, k]
            at += len(part)
        if state:
            raise ValueError(f"{next(iter(state))}: unknown; expected one of {', '.join(Motion._fields)}")
        return self.state

    @cached_property
    def _steered(self) -> Airframe:
        return known_airframe(self._scene)

    def _rows(self, columns: int) -> np.ndarray:
        """The first numbers of the members, shape (members, columns)."""
        return self._blocks[:, :columns].transpose(0, 2, 1).reshape(-1, columns)

    def _place(self, members: np.ndarray) -> None:
        self._blocks[members // simd_batch.WIDTH, :, members % simd_batch.WIDTH] = self._fresh[members]
        self._ticks[members] = 0

    def _advance(self, voltages: np.ndarray, ticks: int) -> None:
        commands = np.zeros((len(self._ticks), voltages.shape[1]))
        commands[: self.n] = voltages
        flat, (count, columns, _) = self._blocks.reshape(-1), self._blocks.shape
        given = (self._core.method, self._like, flat, columns, self._keys, self._ticks, commands, self._core.step)
        parts = min(cpu_count() or 1, count)
        edges = [count * k // parts for k in range(parts + 1)]

        def fly(k: int) -> None:
            simd_batch.advance(*given, self._core.steps, edges[k], edges[k + 1], ticks)

        if parts == 1:
            fly(0)
        else:
            list(self._pool.map(fly, range(parts)))

    def _voltages(self, thrust: np.ndarray, body_rates: np.ndarray) -> np.ndarray:
        """What holds the thrusts that follow body rates, shape (n, rotors) [V]."""
        a = self._steered
        omega, inertia = self._rows(self._motion)[: self.n, OMEGA], np.array(a.inertia_body)
        torque = inertia * RATE_BANDWIDTH * (body_rates - omega) + np.cross(omega, inertia * omega)
        shares, each = (
            np.array(controller_parameters.shares(a)[0]),
            np.array([controller_parameters.lift(a), *controller_parameters.moments(a)]),
        )
        demands = np.column_stack([thrust, torque]) / each
        single = (demands[:, None, :] * shares).sum(axis=2)  # not as a matrix product, whose bits depend on n
        propeller = np.sqrt(np.clip(single, 0.0, None) / a.motor.thrust_coefficient)
        return np.clip(propeller * RPM / (a.motor.gear_ratio * a.motor.speed_constant), 0.0, a.voltage_max)


def _plant(scene: Scene) -> PlantSetup:
    plant: PlantSetup = resolve(scene).services["plant"].parameters
    if not isinstance(plant.core, MultirotorPlant) or not isinstance(plant.start.vehicle.motion, Motion):
        raise SceneError("vehicle.model", f"got {plant.model!r}", '"rigid_body", the only one that batches step')
    if plant.others:
        raise SceneError(
            "effects.shared_slung_load", "batches step vehicles without what they carry", "a scene without it"
        )
    return plant


def _kinds(core: MultirotorPlant) -> tuple:
    return (type(core.method), core.step, core.steps, *map(type, core.vehicle.effects))


def _sound(name: str, given: ArrayLike | None, shape: tuple[int, ...]) -> np.ndarray:
    """An array of finite numbers of a shape."""
    try:
        found = np.asarray(given, float)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.shape != shape:
        raise ValueError(f"{name}: expected numbers of shape {shape}, got {np.shape(given)}")  # type: ignore[arg-type]
    if not np.isfinite(found).all():
        raise ValueError(f"{name}: expected finite numbers")
    return found
