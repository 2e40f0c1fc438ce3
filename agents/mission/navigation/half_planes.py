"""Finds the velocity nearest to a wanted one under linear constraints and a speed limit, in two dimensions.

    minimize |v - wanted|   so that   v . normal >= least   for every half-plane, and   |v| <= limit

This is the incremental linear program of de Berg et al., Computational Geometry, chapter 4, as van den Berg et al. use
it for ORCA (Reciprocal n-Body Collision Avoidance, 2011). If no velocity satisfies all constraints, those after the
first `hard` ones are dropped, the last first. If the hard ones cannot all be satisfied, the largest violation is
minimized.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

_EPSILON: Final = 1e-9
_BISECTIONS: Final = 24


class HalfPlane(NamedTuple):
    """Velocities v with v . (east, north) >= least; (east, north) has length 1."""

    east: float
    north: float
    least: float

    def allows(self, velocity: "Velocity", *, but: float = _EPSILON) -> bool:
        """True for a velocity within the half-plane, or outside it by no more than `but` [m/s]."""
        return velocity[0] * self.east + velocity[1] * self.north >= self.least - but


Velocity = tuple[float, float]


def nearest(wanted: Velocity, planes: Sequence[HalfPlane], *, limit: float, hard: int) -> Velocity:
    """The best velocity [m/s]. `planes` by importance; the first `hard` ones are never dropped."""
    kept = list(planes)
    while True:
        found = _solve(wanted, kept, limit)
        if found is not None:
            return found
        if len(kept) <= hard:
            return _least_violation(wanted, kept, limit)
        kept.pop()


def _solve(wanted: Velocity, planes: Sequence[HalfPlane], limit: float) -> Velocity | None:
    """The optimum; None if the half-planes and the disc have no velocity in common."""
    speed = math.hypot(*wanted)
    scale = min(1.0, limit / speed) if speed else 1.0
    v = wanted[0] * scale, wanted[1] * scale
    for i, plane in enumerate(planes):
        if plane.allows(v):
            continue
        on_line = _along(wanted, plane, planes[:i], limit)
        if on_line is None:
            return None
        v = on_line
    return v


def _along(wanted: Velocity, line: HalfPlane, planes: Sequence[HalfPlane], limit: float) -> Velocity | None:
    """The optimum on the border of one half-plane, within all the others."""
    if abs(line.least) > limit:
        return None
    px, py = line.east * line.least, line.north * line.least
    dx, dy = -line.north, line.east
    half = math.sqrt(max(0.0, limit * limit - line.least * line.least))
    low, high = -half, half
    for plane in planes:
        slope = dx * plane.east + dy * plane.north
        gap = plane.least - (px * plane.east + py * plane.north)
        if abs(slope) <= _EPSILON:
            if gap > _EPSILON:
                return None
        elif slope > 0:
            low = max(low, gap / slope)
        else:
            high = min(high, gap / slope)
        if low > high:
            return None
    t = min(high, max(low, dx * wanted[0] + dy * wanted[1]))
    return px + t * dx, py + t * dy


def _least_violation(wanted: Velocity, planes: Sequence[HalfPlane], limit: float) -> Velocity:
    """The velocity for which all constraints hold when relaxed by the same least amount, by bisection."""
    low, high = 0.0, 4 * limit + max((plane.least for plane in planes), default=0.0)
    best = (0.0, 0.0)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        found = _solve(wanted, [plane._replace(least=plane.least - middle) for plane in planes], limit)
        if found is None:
            low = middle
        else:
            best, high = found, middle
    return best
