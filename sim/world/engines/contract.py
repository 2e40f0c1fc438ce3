"""The contract of a world engine: velocities wanted go in, time passes, positions come out. ENU metres, numpy rows.

Row i is node i + 1. The same calls give the same numbers. Engines know nothing of missions, sensors or topics.
"""

from abc import ABC, abstractmethod

import numpy as np
import numpy.typing as npt

Rows = npt.NDArray[np.float64]
"""float64 [nodes, 3]."""
Values = npt.NDArray[np.float64]
"""float64 of any shape."""
Flags = npt.NDArray[np.bool_]


class Engine(ABC):
    """What moves the bodies of a swarm, and says where they are."""

    name: str

    @abstractmethod
    def reset(self, positions: Rows, velocities: Rows | None = None) -> None:
        """Put every body at its position: at rest, or in flight."""

    @abstractmethod
    def advance(self, dt_s: float, wanted_m_s: Rows) -> None:
        """Let `dt_s` pass while every body tries to fly at its wanted velocity."""

    @abstractmethod
    def positions(self) -> Rows: ...

    @abstractmethod
    def velocities(self) -> Rows: ...

    @abstractmethod
    def fall(self, row: int) -> None:
        """The motors of a body are off for good: it falls, whatever velocity is wanted of it."""

    @abstractmethod
    def contacts(self) -> list[tuple[int, int]]:
        """Pairs of nodes that began to touch since the last call, smaller id first; the ground and obstacles are 0."""

    def blocked(self, first: Rows, second: Rows) -> Flags:
        """True where an obstacle stands between `first` and `second` [n, 3]; bodies and the plain do not count."""
        return np.zeros(len(first), bool)

    def power_w(self) -> Values | None:
        """What each body's battery gives now; None for an engine that knows no rotors."""
        return None

    def close(self) -> None:  # noqa: B027  (only physics holds anything)
        """Give back what the engine holds."""
