"""Batch simulator: many vehicles of a scene, stepped together with numpy arrays."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property, partial
from itertools import pairwise
from os import cpu_count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lapwing.api import batch_members
from lapwing.api.short_errors import short_errors
from lapwing.cosim.scene import Overrides, Scene
from lapwing.dynamics import simd_batch
from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.rate_control import RateController
from lapwing.dynamics.terrain import Relief
from lapwing.kernels.row_packing import pack_row, row_width
from lapwing.runs.solver import with_solver
from lapwing.services.autopilot import controller_parameters
from lapwing.services.autopilot.controller_parameters import Airframe
from lapwing.services.autopilot.motor import RPM
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.common.schemas.vehicle_schema import Vehicle
from lapwing.services.plant.models._common import noise_key
from lapwing.services.scene_resolver import load, load_one
from lapwing.studies.campaign.distributions import Distribution
from lapwing.studies.campaign.plan import plan

RATE_BANDWIDTH = 15.0  # [rad/s] of the body-rate controller


class BatchState(NamedTuple):
    """States of n vehicles as arrays; world ENU, body FLU."""

    time: np.ndarray  # [s] time of each since its reset, shape (n,)
    position_world: np.ndarray  # [m], shape (n, 3)
    attitude: np.ndarray  # unit quaternions w, x, y, z, body to world, shape (n, 4)
    velocity_world: np.ndarray  # [m/s], shape (n, 3)
    omega_body: np.ndarray  # [rad/s], shape (n, 3)
    rotor_speed: np.ndarray  # [rad/s], shape (n, rotors)
    valid: np.ndarray  # shape (n,): False after a step with a non-finite state, or a rotation too fast for the solver


class BatchSimulator:
    """Simulation of n vehicles of a scene, without sensors and autopilot.

    ```python
    batch = BatchSimulator("hover", 4096, vary={"vehicle.mass": lapwing.normal(10.4, 0.2)})
    state = batch.step(motor_voltages=np.full((4096, 4), 33.5))
    state = batch.step(thrust=np.full(4096, 102.0), body_rates=np.zeros((4096, 3)), ticks=5)
    batch.reset([3, 17], position_world=(0.0, 0.0, 5.0))
    ```

    With motor voltages, every member is bit-for-bit identical to the plant of `lapwing.fly`.
    """

    @short_errors
    def __init__(
        self,
        scene: Scene | str | Path,
        n: int,
        vary: Mapping[str, Distribution] | None = None,
        overrides: Overrides = (),
        *,
        seed: int = 1,
    ):
        """Place n vehicles at rest at the start of the scene.

        Args:
            scene: path or name of a scene, or a loaded scene; its model is "rigid_body".
            n: number of vehicles.
            vary: distributions of scene keys; member k has the values of run k of a campaign. Each member resolves a
                scene, which takes about 6 ms.
            overrides: see `lapwing.load_scene`.
            seed: seed of the drawn values and of the members' random numbers.

        Raises:
            SceneError: the scene is invalid, or has another model.
            ValueError: n is below 1, or the members differ in their effects, solvers, or tables of numbers, such as the
                heights of a terrain.
        """
        if not hasattr(n, "__index__") or n < 1:
            raise ValueError(f"n: expected a whole number of members, at least 1, got {n!r}")
        base = with_solver(load_one(scene, overrides))
        batch_plan = plan(base.name, (), n, seed, vary)
        first = batch_members.plant_of(load(base, batch_plan.overrides_of(0)))
        self._core, self.n, self.interval = first.core, n, first.core.interval
        self._like = simd_batch.member(first.core.vehicle, first.start.vehicle)
        self._motion = row_width(self._like.motion)
        self._blocks = simd_batch.blocks(n, self._like)
        self._flat = self._blocks.reshape(-1)
        members = len(self._blocks) * simd_batch.WIDTH  # members beyond n fill the last block
        name = base[Vehicle].name
        self._keys = np.array([noise_key(batch_plan.seed_of(min(k, n - 1)), name) for k in range(members)], np.int64)
        self._ticks = np.zeros(members, np.int64)
        self._valid = np.ones(members, bool)
        self._terrains = [batch_members.terrain_of(first.core)] * n
        self._initial_rows = np.empty((members, row_width(self._like)))  # rows of the members before their first step
        self._initial_rows[:] = pack_row(self._like)
        self._commands = np.zeros((members, len(self._like.voltage)))  # [V]
        self.setpoints = np.zeros((members, 4))  # thrust [N], body rates [rad/s]
        for k in range(1, n) if batch_plan.keys else ():
            plant = batch_members.plant_of(load(base, batch_plan.overrides_of(k)))
            batch_members.check_alike(k, plant.core, first.core)
            self._terrains[k] = batch_members.terrain_of(plant.core)
            self._initial_rows[k] = pack_row(simd_batch.member(plant.core.vehicle, plant.start.vehicle))
        self._place(np.arange(n))
        self._fill()
        self._pool = ThreadPoolExecutor(cpu_count())
        self._scene = base

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for copies and pickles, without threads and compiled code."""
        return {name: value for name, value in vars(self).items() if name not in ("_pool", "_flat", "_advance_blocks")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a copy with its own memory, aligned for compiled code."""
        vars(self).update(state)
        self._blocks = simd_batch.blocks(self.n, self._like)
        self._blocks[:] = state["_blocks"]
        self._flat = self._blocks.reshape(-1)
        self._pool = ThreadPoolExecutor(cpu_count())

    @property
    def level_ground(self) -> bool:
        """True if no member can touch other than level ground."""
        return not any(isinstance(ground, Relief) for ground in self._terrains)

    @property
    def weight(self) -> float:
        """Weight of the nominal vehicle [N]."""
        return self._nominal_airframe.mass * self._nominal_airframe.gravity

    @property
    def hover_speed(self) -> np.ndarray:
        """Rotor speeds [rad/s] at which each rotor carries the same part of the nominal weight; shape (rotors,)."""
        thrust = self.weight / controller_parameters.lift(self._nominal_airframe)
        return np.full(len(self._like.voltage), np.sqrt(thrust / self._nominal_airframe.motor.thrust_coefficient))

    @property
    def memory(self) -> tuple[np.ndarray, int, np.ndarray, np.ndarray]:
        """Memory for compiled code: flat `simd_batch.blocks`, number of columns of a block, ticks, validity."""
        return self._flat, self._blocks.shape[1], self._ticks, self._valid

    @property
    def state(self) -> BatchState:
        """Copy of the current states."""
        rows = self._rows(self._motion)[: self.n]
        parts, column = [], 0
        for part in self._like.motion:
            parts.append(rows[:, column : column + len(part)].copy())
            column += len(part)
        return BatchState._make([self._ticks[: self.n] * self.interval, *parts, self._valid[: self.n].copy()])

    def step(
        self,
        motor_voltages: ArrayLike | None = None,
        thrust: ArrayLike | None = None,
        body_rates: ArrayLike | None = None,
        ticks: int = 1,
        strict: bool = False,
    ) -> BatchState:
        """Advance by `ticks` under one command.

        Args:
            motor_voltages: [V] of each motor, shape (n, rotors); or
            thrust: [N] total thrust, shape (n,), and
            body_rates: [rad/s] desired body rates, shape (n, 3), for a proportional controller with a bandwidth of
                15 rad/s that runs at every tick with the nominal airframe.
            ticks: number of ticks; a tick is `interval` [s].
            strict: True to raise an error if a member is no longer valid.

        Raises:
            ValueError: invalid command, shape or value; with `strict`, names the members that are not `valid`.
        """
        if (motor_voltages is None) == (thrust is None) or (thrust is None) != (body_rates is None):
            raise ValueError("step: expected motor_voltages, or thrust and body_rates")
        if not isinstance(ticks, int) or ticks < 1:
            raise ValueError(f"step: expected ticks = 1, 2, ..., got {ticks!r}")
        if motor_voltages is not None:
            self._advance(
                batch_members.finite_array("motor_voltages", motor_voltages, (self.n, len(self._like.voltage))), ticks
            )
        else:
            self.setpoints[: self.n, 0] = batch_members.finite_array("thrust", thrust, (self.n,))
            self.setpoints[: self.n, 1:] = batch_members.finite_array("body_rates", body_rates, (self.n, 3))
            self.setpoints[self.n :] = self.setpoints[self.n - 1]
            self.run_blocks(lambda first, last: self.advance_under_rates(first, last, ticks))
        if strict and not self._valid[: self.n].all():
            members = ", ".join(map(str, np.flatnonzero(~self._valid[: self.n])[:10]))
            raise ValueError(f"step: members {members} are not finite or turn too fast for the step; reset them")
        return self.state

    def reset(self, members: Sequence[int] | np.ndarray | None = None, **state: ArrayLike) -> BatchState:
        """Restart members with the same random numbers, at the start of the scene or in another state.

        Args:
            members: numbers of the members; None for all.
            state: fields of `BatchState` except the time, one value for all members or one for each.

        Raises:
            ValueError: unknown member or field, or another shape.
        """
        self.restart(members, **state)
        return self.state

    def restart(self, members: Sequence[int] | np.ndarray | None = None, **state: ArrayLike) -> None:
        """Restart members as `reset` does, without copying the states."""
        selected = np.arange(self.n) if members is None else np.atleast_1d(np.asarray(members))
        if selected.dtype == bool:
            selected = np.flatnonzero(selected)
        if selected.size and not (selected.dtype.kind in "iu" and selected.min() >= 0 and selected.max() < self.n):
            raise ValueError(f"members: expected numbers from 0 to {self.n - 1}")
        batch_members.check_start(state, selected, self._terrains)
        self._place(selected)
        column = 0
        for name, part in zip(Motion._fields, self._like.motion, strict=True):
            if name in state:
                shape, start = (len(selected), len(part)), state.pop(name)
                start = np.broadcast_to(start, shape) if np.shape(start) == shape[1:] else start
                value = batch_members.finite_array(name, start, shape)
                for k in range(len(part)):
                    self._blocks[selected // simd_batch.WIDTH, column + k, selected % simd_batch.WIDTH] = value[:, k]
            column += len(part)
        if state:
            raise ValueError(f"{next(iter(state))}: unknown; expected one of {', '.join(Motion._fields)}")
        self._fill()

    def run_blocks(self, work: Callable[[int, int], None]) -> None:
        """Call work(first, last) for parts of the blocks, one part for each core, in this and other threads."""
        count = len(self._blocks)
        parts = min(cpu_count() or 1, count)
        edges = [count * k // parts for k in range(parts + 1)]
        others = [self._pool.submit(work, *part) for part in pairwise(edges[1:])]
        work(edges[0], edges[1])
        for other in others:
            other.result()

    def advance_under_rates(self, first: int, last: int, ticks: int) -> None:
        """Advance the blocks [first, last) under the rows of `setpoints`."""
        self._advance_blocks(first, last, ticks, self._controller, self.setpoints)

    @cached_property
    def _advance_blocks(self) -> Callable[..., None]:
        """`simd_batch.advance` with the arguments that stay the same."""
        memory = (self._like, self._flat, self._blocks.shape[1], self._keys, self._ticks, self._commands, self._valid)
        return partial(simd_batch.advance, self._core.method, *memory, self._core.step, self._core.steps)

    @cached_property
    def _controller(self) -> RateController:
        a, motor = self._nominal_airframe, self._nominal_airframe.motor
        unit = np.array([controller_parameters.lift(a), *controller_parameters.moments(a)])
        mixer = np.array(controller_parameters.shares(a)[0]) / unit
        speed = RPM / (motor.gear_ratio * motor.speed_constant)
        return RateController(RATE_BANDWIDTH, a.inertia_body, mixer, motor.thrust_coefficient, speed, a.voltage_max)

    @cached_property
    def _nominal_airframe(self) -> Airframe:
        return known_airframe(self._scene)

    def _rows(self, columns: int) -> np.ndarray:
        """Return the first numbers of the batch elements, shape (members, columns)."""
        return self._blocks[:, :columns].transpose(0, 2, 1).reshape(-1, columns)

    def _place(self, members: np.ndarray) -> None:
        self._blocks[members // simd_batch.WIDTH, :, members % simd_batch.WIDTH] = self._initial_rows[members]
        self._ticks[members] = 0
        self._valid[members] = True

    def _fill(self) -> None:
        """Copy the last member to the rest of its block, since vehicles on the ground would slow the others down."""
        last = (self.n - 1) % simd_batch.WIDTH
        self._blocks[-1, :, last + 1 :] = self._blocks[-1, :, last, None]
        self._ticks[self.n :] = self._ticks[self.n - 1]
        self._valid[self.n :] = True

    def _advance(self, voltages: np.ndarray, ticks: int) -> None:
        self._commands[: self.n], self._commands[self.n :] = voltages, voltages[-1]
        self.run_blocks(lambda first, last: self._advance_blocks(first, last, ticks))
