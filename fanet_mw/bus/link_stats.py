"""What each directed link carried in a stretch of time, as the medium counted it: columns, because there are thousands.

    copies on a link = received + lost by reason (LOSSES), counted when they end; ACKs are not among them

Does not model: which frames they were (that is a capture's business), nor links that carried nothing.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from typing import Final, NamedTuple

from fanet_mw.errors import DropReason
from fanet_mw.units import NodeId

LOSSES: Final = (
    DropReason.COLLISION,
    DropReason.HALF_DUPLEX,
    DropReason.WEAK_SIGNAL,
    DropReason.DEGRADED,
    DropReason.JAMMED,
    DropReason.STATION_DOWN,
)
COUNTS: Final = 1 + len(LOSSES)
"""Per link: copies received, then copies lost by reason."""


class LinkRow(NamedTuple):
    """One directed link."""

    src: NodeId
    dst: NodeId
    received: int
    lost: tuple[int, ...]
    """In the order of LOSSES."""
    rssi_sum_mdbm: int
    """Sum over the copies received [1/1000 dBm]."""

    @property
    def copies(self) -> int:
        return self.received + sum(self.lost)

    @property
    def rssi_dbm(self) -> float | None:
        """Mean over the copies received [dBm]; None when there were none."""
        return self.rssi_sum_mdbm / self.received / 1000 if self.received else None


class LinkStats(NamedTuple):
    """Medium -> whoever looks: every link with traffic since the report before, by source and destination.

    One a second, at whole seconds, and one at the end; none while the air is silent.
    """

    t_ns: int
    span_ns: int
    """Since the report before, silence included."""
    ends: array[int]
    """`array('H')`: source and destination of each link."""
    counts: array[int]
    """`array('I')`: COUNTS per link."""
    rssi_sums_mdbm: array[int]
    """`array('q')`: one per link."""

    def rows(self) -> Iterator[LinkRow]:
        """Link by link."""
        for i, rssi_sum_mdbm in enumerate(self.rssi_sums_mdbm):
            received, *lost = self.counts[i * COUNTS : (i + 1) * COUNTS]
            yield LinkRow(NodeId(self.ends[2 * i]), NodeId(self.ends[2 * i + 1]), received, tuple(lost), rssi_sum_mdbm)
