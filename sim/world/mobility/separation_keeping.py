"""Keeps UAVs apart that the world itself flies: they slow down towards each other, and are pushed apart when too near.

UAVs that are flown by their companion computers avoid each other by what they have received (`agents/`).
"""

import math
from typing import Final

import numpy as np

from sim.world.arrays import Rows
from sim.world.mobility.geofence import BRAKE_M_S2

CLEAR_M: Final = 4.0
"""The distance that UAVs keep from each other; UAVs within twice this distance are pushed apart."""
_PUSH_M_S: Final = 4.0
"""The greatest speed by which one neighbor pushes a UAV away."""
_ROUNDS: Final = 4
"""How often the speed towards the worst neighbor is reduced, because reducing one may increase another."""


def kept_clear(wish: Rows, at: Rows, see_m: float) -> Rows:
    """Cap each UAV's speed towards each neighbor within `see_m`, and push apart those that are too near. Two that brake
    at `BRAKE_M_S2` from v each need v^2 / BRAKE_M_S2, which is the gap between them less `CLEAR_M`.
    """
    apart = at[:, None] - at[None]
    distance = np.sqrt((apart**2).sum(axis=2))
    np.fill_diagonal(distance, math.inf)
    near = distance < see_m
    rows = np.flatnonzero(near.any(axis=1))
    if not len(rows):
        return wish
    gap = np.where(near[np.ix_(rows, rows)], distance[np.ix_(rows, rows)], math.inf)
    away = apart[np.ix_(rows, rows)] / np.maximum(distance[np.ix_(rows, rows)], 1e-6)[..., None]
    cap = np.sqrt(BRAKE_M_S2 * np.maximum(0.0, gap - CLEAR_M))
    push = np.maximum(0.0, 1 - gap / (2 * CLEAR_M))
    own = wish[rows] + _PUSH_M_S * (push[..., None] * away).sum(axis=1)
    every = np.arange(len(rows))
    for _ in range(_ROUNDS):  # the worst neighbor first; a correction for one may close in on another
        excess = -np.einsum("ik,ijk->ij", own, away) - cap
        worst = excess.argmax(axis=1)
        own += np.maximum(0.0, excess[every, worst])[:, None] * away[every, worst]
    wish[rows] = own
    return wish
