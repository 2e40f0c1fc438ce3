"""The traffic of each link over a whole run: sums of the medium's reports, as rows of `links.json`."""

from collections.abc import Iterable
from typing import Any, Final, Self

import numpy as np

from fanet_mw.bus.link_stats import COUNTS, LOSSES, LinkRow, LinkStats
from fanet_mw.units import NodeId

_PENDING: Final = 64
"""The number of reports that are summed together, so that memory does not grow with the length of a run."""


class LinkTotals:
    """The sums for each directed link. The memory depends on the number of links, not on that of reports."""

    def __init__(self) -> None:
        self._pending: list[LinkStats] = []
        self._links = np.zeros((0, 2), np.uint16)
        self._sums = np.zeros((0, 1 + COUNTS), np.int64)

    @classmethod
    def of(cls, rows: Iterable[LinkRow]) -> Self:
        found, totals = list(rows), cls()
        totals._links = np.array([[row.src, row.dst] for row in found], np.uint16).reshape(-1, 2)
        sums = [[row.rssi_sum_mdbm, row.received, *row.lost] for row in found]
        totals._sums = np.array(sums, np.int64).reshape(-1, 1 + COUNTS)
        return totals

    def add(self, stats: LinkStats) -> None:
        self._pending.append(stats)
        if len(self._pending) >= _PENDING:
            self._merge()

    def rows(self) -> list[LinkRow]:
        """All links, in the order of source and destination."""
        self._merge()
        return [
            LinkRow(NodeId(src), NodeId(dst), received, tuple(lost), rssi_sum)
            for (src, dst), (rssi_sum, received, *lost) in zip(self._links.tolist(), self._sums.tolist(), strict=True)
        ]

    def _merge(self) -> None:
        ends, sums = [self._links], [self._sums]
        for report in self._pending:
            ends.append(np.frombuffer(report.ends, np.uint16).reshape(-1, 2))
            counts = np.frombuffer(report.counts, np.uint32).reshape(-1, COUNTS).astype(np.int64)
            sums.append(np.column_stack([np.frombuffer(report.rssi_sums_mdbm, np.int64), counts]))
        self._pending.clear()
        self._links, place = np.unique(np.concatenate(ends), axis=0, return_inverse=True)
        self._sums = np.zeros((len(self._links), 1 + COUNTS), np.int64)
        np.add.at(self._sums, place.reshape(-1), np.concatenate(sums))


def described(rows: Iterable[LinkRow]) -> list[dict[str, Any]]:
    """The rows of `links.json`; RSSI: the mean of the received ones [dBm], if the channel knows any."""
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
