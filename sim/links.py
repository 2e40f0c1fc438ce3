"""What links carried over a whole run: sums of the medium's reports, as rows for a file."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from fanet_mw.link_stats import COUNTS, LOSSES, LinkRow, LinkStats
from fanet_mw.units import NodeId


class LinkTotals:
    """Sums per directed link; reports are kept as they come and summed when asked for."""

    def __init__(self) -> None:
        self._reports: list[LinkStats] = []

    def add(self, stats: LinkStats) -> None:
        """Take in one report."""
        self._reports.append(stats)

    def rows(self) -> list[LinkRow]:
        """All links, by source and destination."""
        if not self._reports:
            return []
        ends = np.concatenate([np.frombuffer(report.ends, np.uint16) for report in self._reports])
        counts = np.concatenate([np.frombuffer(report.counts, np.uint32) for report in self._reports])
        rssi = np.concatenate([np.frombuffer(report.rssi_sums_mdbm, np.int64) for report in self._reports])
        links, place = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
        sums = np.zeros((len(links), 1 + COUNTS), np.int64)
        np.add.at(sums, place.reshape(-1), np.column_stack([rssi, counts.reshape(-1, COUNTS).astype(np.int64)]))
        return [
            LinkRow(NodeId(src), NodeId(dst), received, tuple(lost), rssi_sum)
            for (src, dst), (rssi_sum, received, *lost) in zip(links.tolist(), sums.tolist(), strict=True)
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
