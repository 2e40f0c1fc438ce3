"""Statistics of directed links over a span of time, as the medium counts them: one column per figure.

    copies on a link = received + lost by reason (LOSSES), counted when they end; ACKs are not included

The statistics do not tell which frames were lost (a capture does), and leave out links without traffic.
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
"""The number of counters per link: copies received, and copies lost by each reason."""


class LinkRow(NamedTuple):
    """One directed link."""

    src: NodeId
    dst: NodeId
    received: int
    lost: tuple[int, ...]
    """The number of lost copies for each reason, in the order of LOSSES."""
    rssi_sum_mdbm: int
    """The sum of the RSSI over all received copies [1/1000 dBm]; 0 where the channel knows no powers."""

    @property
    def copies(self) -> int:
        return self.received + sum(self.lost)

    @property
    def rssi_dbm(self) -> float | None:
        """The mean RSSI of the received copies [dBm]; None if there were none, or the channel knows no powers."""
        return self.rssi_sum_mdbm / self.received / 1000 if self.received and self.rssi_sum_mdbm else None


class LinkStats(NamedTuple):
    """Medium -> any observer: every link with traffic since the previous report, by source and destination.

    There is one report a second, at whole seconds, and one at the end; none while the air is silent.
    """

    t_ns: int
    span_ns: int
    """The time since the previous report, silence included."""
    ends: array[int]
    """`array('H')`: source and destination of each link."""
    counts: array[int]
    """`array('I')`: COUNTS per link."""
    rssi_sums_mdbm: array[int]
    """`array('q')`: one per link."""

    def rows(self) -> Iterator[LinkRow]:
        for i, rssi_sum_mdbm in enumerate(self.rssi_sums_mdbm):
            received, *lost = self.counts[i * COUNTS : (i + 1) * COUNTS]
            yield LinkRow(NodeId(self.ends[2 * i]), NodeId(self.ends[2 * i + 1]), received, tuple(lost), rssi_sum_mdbm)
