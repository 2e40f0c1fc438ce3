"""Delays of packets from application to application: their statistics, and the parts of which they consist.

hand-over ......... let out ......... end of the frame ......... receipt
|  lead  |  queue  |      air, relays included      |  handover  |
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from fanet_mw.trace import Delivered
from fanet_mw.units import MS
from sim.results.packets import Name, Sent

PARTS: Final = ("lead", "queue", "air", "handover")


def summed_up(delays_ns: Sequence[int]) -> dict[str, float | None]:
    """Mean, percentiles and maximum of some delays [ms]; None for each when there are no delays."""
    if not delays_ns:
        return dict.fromkeys(("mean", "p50", "p95", "p99", "max"))
    values = np.asarray(delays_ns, dtype=np.float64) / MS
    p50, p95, p99 = np.percentile(values, (50, 95, 99))
    named = {"mean": values.mean(), "p50": p50, "p95": p95, "p99": p99, "max": values.max()}
    return {name: round(float(value), 3) for name, value in named.items()}


def parts(delivered: Iterable[Delivered], sent: Mapping[Name, Sent], *, lead_ns: int) -> dict[str, float | None]:
    """The mean of each part [ms], over the deliveries of packets that are known to have left their origin."""
    rows = [_row(record, sent[record.origin, record.seq], lead_ns) for record in delivered]
    known = [row for row in rows if row is not None]
    if not known:
        return dict.fromkeys(PARTS)
    means = np.asarray(known, dtype=np.float64).mean(axis=0) / MS
    return {name: round(float(mean), 3) for name, mean in zip(PARTS, means, strict=True)}


def _row(record: Delivered, sent: Sent, lead_ns: int) -> tuple[int, int, int, int] | None:
    if sent.out_ns is None:
        return None
    waited_ns = sent.out_ns - sent.born_ns
    lead_part_ns = min(lead_ns, waited_ns)
    air_ns = record.delay_ns - waited_ns - record.handover_ns
    return lead_part_ns, waited_ns - lead_part_ns, air_ns, record.handover_ns
