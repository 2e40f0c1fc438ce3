"""Compares delays with the bounds that were promised: each packet's origin states one when it accepts the packet.

    within_share = deliveries within the bound of their packet / (all packets x the nodes for which each was meant)

A promise is broken at each target at which a packet with a bound arrives too late, or never, if the bound was over
before the run. Packets of users' applications, whose targets the trace does not tell, are in no share.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from fanet_mw.units import MS
from sim.records.delivery_columns import Column
from sim.results.packets import AppPackets


def against_bounds(applications: Mapping[str, AppPackets], *, ended_ns: int) -> dict[str, Any]:
    """The table `bound` of `summary.json`, for all applications together and for each."""
    promised = {name: app for name, app in applications.items() if _promises(app)}
    if not promised:
        return {}
    return {
        **_judged([app for app in applications.values() if app.sent], ended_ns),
        "classes": {name: _judged([app], ended_ns) for name, app in promised.items()},
    }


def likely(applications: Mapping[str, AppPackets]) -> dict[str, Any]:
    """The table `likely` of `summary.json`; empty if no origin stated a delay. within_share = deliveries within the
    delay stated for their packet / (packets with a statement x their targets, without nodes taken to be gone)
    """
    stated = [
        (app, name, sent.likely) for app in applications.values() for name, sent in app.sent.items() if sent.likely
    ]
    if not stated:
        return {}
    delays = {name: delay_ns for _, name, (delay_ns, _) in stated}
    within = 0
    for app in applications.values():
        delays_ns, limits_ns = _beside(app, [sent.likely[0] if sent.likely else -1 for sent in app.sent.values()])
        within += int((delays_ns <= limits_ns)[_not_excluded(app)].sum()) if app.wanted else 0
    wanted = sum(app.sent[name].targets for app, name, _ in stated)
    packets = sum(len(app.sent) for app in applications.values())
    return {
        "share": min(share for _, _, (_, share) in stated),
        "within_share": round(within / wanted, 6) if wanted else None,
        "stated_share": round(len(stated) / packets, 6),
        "worst_ms": round(max(delays.values()) / MS, 3),
    }


def _promises(app: AppPackets) -> bool:
    return any(sent.bound_ns is not None for sent in app.sent.values())


def _judged(apps: list[AppPackets], ended_ns: int) -> dict[str, Any]:
    bounds = [sent.bound_ns for app in apps for sent in app.sent.values()]
    stated = [bound_ns for bound_ns in bounds if bound_ns is not None]
    wanted = sum(app.wanted for app in apps)
    deliveries = within_wanted = late = never = longest_ns = 0
    for app in apps:
        delays_ns, bounds_ns = delays_under_bound(app)
        deliveries += len(delays_ns)
        in_time = int((delays_ns <= bounds_ns).sum())
        late += len(delays_ns) - in_time
        never += _never_there(app, ended_ns)
        within_wanted += in_time if app.wanted else 0
        longest_ns = max(longest_ns, int(delays_ns.max(initial=0)))
    return {
        "within_share": round(within_wanted / wanted, 6) if wanted else None,
        "violations": late + never,
        "never": never,
        "deliveries": deliveries,
        "stated_share": round(len(stated) / len(bounds), 6),
        "worst_ms": round(max(stated) / MS, 3),
        "observed_max_ms": round(longest_ns / MS, 3),
    }


def _never_there(app: AppPackets, ended_ns: int) -> int:
    """The number of targets that a packet never reached although the bound that was stated for it is over."""
    promised = app.deliveries.packet[_not_excluded(app)]
    arrived = np.bincount(promised, minlength=len(app.sent)).tolist()
    return sum(
        max(0, sent.targets - count)
        for sent, count in zip(app.sent.values(), arrived, strict=True)
        if sent.bound_ns is not None and sent.born_ns + sent.bound_ns < ended_ns
    )


def delays_under_bound(app: AppPackets) -> tuple[Column, Column]:
    """The delays of all deliveries for which a bound was stated, and those bounds."""
    delays_ns, bounds_ns = _beside(app, [-1 if sent.bound_ns is None else sent.bound_ns for sent in app.sent.values()])
    promised = (bounds_ns >= 0) & _not_excluded(app)
    return delays_ns[promised], bounds_ns[promised]


def _not_excluded(app: AppPackets) -> npt.NDArray[np.bool_]:
    """For each delivery, whether the packet's bound was stated for the node."""
    pairs = [
        number << 16 | node for number, sent in enumerate(app.sent.values()) if sent.excluded for node in sent.excluded
    ]
    return ~np.isin(app.deliveries.packet.astype(np.int64) << 16 | app.deliveries.node, np.array(pairs, np.int64))


def _beside(app: AppPackets, of_packets: list[int]) -> tuple[Column, Column]:
    """The delay of each delivery, and the value in `of_packets` of its packet."""
    figures = np.array(of_packets, dtype=np.int64)
    return app.deliveries.delay_ns, figures[app.deliveries.packet]
