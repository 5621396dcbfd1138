"""Tension of the links of a shared load, from recorded poses and thrusts."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.flights.topic_view import TopicView
from lapwing.kernels import python_function

GAP = 0.05  # [s] shorter gaps do not separate two pushes


class Push(NamedTuple):
    """Interval in which a link pushes, where a cable would be slack."""

    start: float  # [s] time at which the tension vanishes
    stop: float  # [s]
    most: float  # [N] largest compression


def tension(position: np.ndarray, velocity: np.ndarray, force: np.ndarray, load: Mapping[str, Any]) -> np.ndarray:
    """Return the tension of k links [N], negative where they push (theory, eq. (7.28)), shape (n, k).

    Args:
        position: positions of the load and the quadrotors [m], world, shape (n, 1 + k, 3).
        velocity: their velocities [m/s], world, shape (n, 1 + k, 3).
        force: rotor force of each quadrotor [N], world, shape (n, k, 3).
        load: quad_mass [kg], link_length [m], load_mass [kg], as in the scene's table [cooperative_load].
    """
    mass, length = np.array(load["quad_mass"]), np.array(load["link_length"])
    q = position[:, :1] - position[:, 1:]
    q = q / np.linalg.norm(q, axis=2, keepdims=True)
    centripetal = np.sum((velocity[:, :1] - velocity[:, 1:]) ** 2, axis=2) / length
    along = np.sum(q * force, axis=2)
    inertia = load["load_mass"] * np.eye(3) + np.einsum("i,nij,nik->njk", mass, q, q)
    pull = np.einsum("ni,nij->nj", along - mass * centripetal, q)
    specific = np.linalg.solve(inertia, pull[..., None])[..., 0]  # [m/s^2] acceleration of the load, less gravity
    return mass * (np.einsum("nij,nj->ni", q, specific) + centripetal) - along


def link_tension(bodies: TopicView, lift: TopicView, load: Mapping[str, Any]) -> np.ndarray:
    """Return the `tension` of a flight from the topics "body_states" (the load first) and "rotor_wrench"."""
    n = min(len(bodies), len(lift))
    x, y, z, w = np.moveaxis(bodies.orientation[:n, 1:], 2, 0)
    matrix = python_function(rotation_matrix)((w, x, y, z))
    force = np.asarray(lift.thrust)[:n, :, None] * np.stack([matrix[2], matrix[5], matrix[8]], axis=2)
    return tension(bodies.position[:n], bodies.velocity[:n], force, load)


def pushes(t: np.ndarray, tension: np.ndarray) -> list[Push]:
    """Return the intervals in which a link pushes; their start is interpolated linearly.

    Args:
        t: times [s], shape (n,).
        tension: tension of the link [N], shape (n,).
    """
    rows = np.flatnonzero(tension < 0.0)
    if not len(rows):
        return []
    result = []
    apart = (np.diff(rows) > 1) & (np.diff(t[rows]) > GAP)
    for piece in np.split(rows, np.flatnonzero(apart) + 1):
        first, last = piece[0], piece[-1]
        start = float(t[first])
        if first > 0:
            before, after = tension[first - 1], tension[first]
            start -= float((t[first] - t[first - 1]) * after / (after - before))
        result.append(Push(start, float(t[last]), float(-tension[piece].min())))
    return result
