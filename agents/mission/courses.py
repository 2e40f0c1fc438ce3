"""Makes a course of a velocity."""

from typing import Final

from fanet_mw.application import Course
from fanet_mw.units import Enu

_AHEAD_S: Final = 10.0
"""A course leads to a point this far ahead. The farther it is, the less does the error of a fix turn the course."""


def course_at(here: Enu, velocity: Enu) -> Course:
    """The course that flies on at a velocity, to a point far ahead."""
    ahead = Enu(
        here.east + velocity.east * _AHEAD_S, here.north + velocity.north * _AHEAD_S, here.up + velocity.up * _AHEAD_S
    )
    return Course(ahead, velocity.norm(), velocity)
