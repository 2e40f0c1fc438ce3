"""What links carried over a whole run: sums of the medium's reports, as rows for a file."""

from collections.abc import Iterable
from typing import Any

from fanet_mw.link_stats import COUNTS, LOSSES, LinkRow, LinkStats
from fanet_mw.units import NodeId


class LinkTotals:
    """Sums per directed link."""

    def __init__(self) -> None:
        self._sums: dict[tuple[int, int], list[int]] = {}
        self.t_ns = 0
        """Instant of the last report."""

    def add(self, stats: LinkStats) -> None:
        """Take in one report."""
        self.t_ns = max(self.t_ns, stats.t_ns)
        for row in stats.rows():
            sums = self._sums.setdefault((row.src, row.dst), [0] * (1 + COUNTS))
            for i, value in enumerate((row.rssi_sum_mdbm, row.received, *row.lost)):
                sums[i] += value

    def rows(self) -> list[LinkRow]:
        """All links, by source and destination."""
        return [
            LinkRow(NodeId(src), NodeId(dst), received, tuple(lost), rssi_sum)
            for (src, dst), (rssi_sum, received, *lost) in sorted(self._sums.items())
        ]


def described(rows: Iterable[LinkRow]) -> list[dict[str, Any]]:
    """The content of `links.json`: copies, received, lost by reason, and the mean RSSI [dBm] of those received."""
    return [
        {
            "src": row.src,
            "dst": row.dst,
            "copies": row.copies,
            "received": row.received,
            "lost": {reason.value: count for reason, count in zip(LOSSES, row.lost, strict=True) if count},
            "rssi_dbm": None if row.rssi_dbm is None else round(row.rssi_dbm, 2),
        }
        for row in rows
    ]
