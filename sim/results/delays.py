"""Delays of packets from application to application: statistics, and the parts of which a delay consists.

hand-over ......... release ......... end of the frame ......... receipt
|  lead  |  queue  |      air, relays included      |  handover  |
"""

import math
from typing import Final

import numpy as np

from fanet_mw.units import MS
from sim.records.delivery_columns import Column
from sim.results.packets import AppPackets, SentPacket

PARTS: Final = ("lead", "queue", "air", "handover")


def summed_up(delays_ns: Column) -> dict[str, float | None]:
    """The mean, the percentiles and the maximum of some delays [ms]; None for each if there are no delays."""
    if not len(delays_ns):
        return dict.fromkeys(("mean", "p50", "p95", "p99", "max"))
    values = delays_ns.astype(np.float64) / MS
    p50, p95, p99 = np.percentile(values, (50, 95, 99))
    named = {"mean": values.mean(), "p50": p50, "p95": p95, "p99": p99, "max": values.max()}
    return {name: round(float(value), 3) for name, value in named.items()}


def parts(app: AppPackets, *, lead_ns: int) -> dict[str, float | None]:
    """The mean of each part [ms], over the deliveries of packets whose release is known."""
    waited = np.array([_waited_ns(sent) for sent in app.sent.values()], dtype=np.float64)
    deliveries = app.deliveries
    waited_ns = waited[deliveries.packet]
    known = ~np.isnan(waited_ns)
    if not known.any():
        return dict.fromkeys(PARTS)
    waited_ns = waited_ns[known]
    lead_part_ns = np.minimum(lead_ns, waited_ns)
    handover_ns = deliveries.handover_ns[known].astype(np.float64)
    air_ns = deliveries.delay_ns[known].astype(np.float64) - waited_ns - handover_ns
    columns = lead_part_ns, waited_ns - lead_part_ns, air_ns, handover_ns
    return {name: round(float(column.mean()) / MS, 3) for name, column in zip(PARTS, columns, strict=True)}


def _waited_ns(sent: SentPacket) -> float:
    """The time from the hand-over of a packet to its release; NaN if it is not known."""
    return math.nan if sent.out_ns is None else float(sent.out_ns - sent.born_ns)
