"""The contract of a world engine: wanted velocities go in, time passes, positions come out. ENU metres, one row per
node.

Row i is node i + 1. The same calls give the same results. Engines know nothing of missions, sensors or topics.
"""

from abc import ABC, abstractmethod
from typing import Final

from sim.world.arrays import Flags, Rows, Values
from sim.world.engines.contacts import Contacts

GRAVITY_M_S2: Final = 9.81


class Engine(ABC):
    """Moves the bodies of a swarm."""

    name: str
    _at: Rows
    _velocity: Rows
    _wrecks: list[int]
    """The rows of the bodies that fall."""
    _contacts: Contacts

    @abstractmethod
    def reset(self, positions: Rows, velocities: Rows | None = None) -> None:
        """Put all bodies at their positions, at rest or in flight."""

    @abstractmethod
    def advance(self, dt_s: float, wanted_m_s: Rows) -> None:
        """Let `dt_s` pass, while each body tries to fly at its wanted velocity."""

    def positions(self) -> Rows:
        return self._at

    def velocities(self) -> Rows:
        return self._velocity

    def fall(self, row: int) -> None:
        """Switch the motors of a body off for good: it falls, whatever velocity is wanted."""
        self._wrecks.append(row)

    def contacts(self) -> list[tuple[int, int]]:
        """Pairs of nodes that have begun to touch since the last call, the smaller id first; 0 stands for the ground
        and obstacles.
        """
        return self._contacts.take()

    def stand(self, rows: Flags) -> None:  # noqa: B027  (an engine without wind moves nobody who wants no velocity)
        """Switch the motors of these bodies off until the next call: they stand where friction holds them, or sink."""

    def drift(self, rows: Flags, tilt_m_s2: Rows) -> None:  # noqa: B027  (where no air moves nobody is taken along)
        """Let these bodies control nothing but their heights until the next call, with attitudes that are level but for
        errors by which all would accelerate so much [n, 3].
        """

    def power_w(self) -> Values | None:
        """The power that each battery delivers now; None for an engine without rotors."""
        return None

    def air_m_s(self) -> Rows | None:
        """The velocity of the air around each body; None for an engine without wind."""
        return None

    def close(self) -> None:  # noqa: B027  (only physics holds anything)
        """Release the resources of the engine."""
