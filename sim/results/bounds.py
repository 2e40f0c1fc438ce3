"""Compares delays with the bounds that were promised: each packet's origin states one when it accepts the packet.

    within_share = deliveries within the bound of their packet / (all packets x the nodes for which each was meant)

A promise is broken at each target at which a packet with a bound arrives too late, or never, if the bound was over
before the run. It is overtaken by a fault that begins before the bound is over, and by one that has begun so lately
that its origin need not know of it; the line of a partition and a jammed area surprise whoever flies there until they
end.
Packets of users' applications, whose targets the trace does not tell, are in no share.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fanet_mw.trace import RadioFault
from fanet_mw.units import MS, S
from sim.records.delivery_columns import Column
from sim.results.packets import AppPackets

UNNOTICED_NS: Final = 4 * S
"""So long after a fault has begun bounds may count on what is gone."""
_OF_PLACES: Final = ("partition", "jam")
"""Faults that UAVs fly into as long as they last."""

Span = tuple[int, int]


def against_bounds(
    applications: Mapping[str, AppPackets], faults: Iterable[RadioFault], *, ended_ns: int
) -> dict[str, Any]:
    """The table `bound` of `summary.json`, for all applications together and for each."""
    promised = {name: app for name, app in applications.items() if _promises(app)}
    if not promised:
        return {}
    surprises = _surprises(faults, ended_ns)
    return {
        **_judged([app for app in applications.values() if app.sent], surprises, ended_ns),
        "classes": {name: _judged([app], surprises, ended_ns) for name, app in promised.items()},
    }


def _surprises(faults: Iterable[RadioFault], ended_ns: int) -> list[Span]:
    """When each fault is one that not everybody knows of."""
    spans, open_spans = list[Span](), dict[str, tuple[RadioFault, Span]]()
    for fault in faults:
        began, (since_ns, until_ns) = open_spans.pop(fault.label, (None, (0, 0)))
        if began is not None and began.kind in _OF_PLACES:
            spans.append((since_ns, max(until_ns, fault.t_ns)))
        elif began is not None:
            spans.append((since_ns, until_ns))
        if fault.active:
            open_spans[fault.label] = fault, (fault.t_ns, fault.t_ns + UNNOTICED_NS)
    return spans + [
        (since_ns, max(until_ns, ended_ns) if fault.kind in _OF_PLACES else until_ns)
        for fault, (since_ns, until_ns) in open_spans.values()
    ]


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


def _judged(apps: list[AppPackets], surprises: Sequence[Span], ended_ns: int) -> dict[str, Any]:
    bounds = [sent.bound_ns for app in apps for sent in app.sent.values()]
    stated = [bound_ns for bound_ns in bounds if bound_ns is not None]
    wanted = sum(app.wanted for app in apps)
    deliveries = within_wanted = violations = never = overtaken = longest_ns = 0
    for app in apps:
        delays_ns, _ = delays_under_bound(app)
        deliveries += len(delays_ns)
        late, missing = _late(app), _never_there(app, ended_ns)
        violations += int((late + missing).sum())
        never += int(missing.sum())
        overtaken += int((late + missing)[_overtaken(app, surprises)].sum())
        within_wanted += len(delays_ns) - int(late.sum()) if app.wanted else 0
        longest_ns = max(longest_ns, int(delays_ns.max(initial=0)))
    return {
        "within_share": round(within_wanted / wanted, 6) if wanted else None,
        "violations": violations,
        "never": never,
        "overtaken": overtaken,
        "deliveries": deliveries,
        "stated_share": round(len(stated) / len(bounds), 6),
        "worst_ms": round(max(stated) / MS, 3),
        "observed_max_ms": round(longest_ns / MS, 3),
    }


def _late(app: AppPackets) -> npt.NDArray[np.int64]:
    """Of each packet, how many copies came later than the bound that was stated for them."""
    delays_ns, bounds_ns = _beside(app, _bounds_ns(app))
    came_late = (bounds_ns >= 0) & (delays_ns > bounds_ns) & _not_excluded(app)
    return np.bincount(app.deliveries.packet[came_late], minlength=len(app.sent))


def _never_there(app: AppPackets, ended_ns: int) -> npt.NDArray[np.int64]:
    """The number of targets that each packet never reached although the bound that was stated for it is over."""
    promised = app.deliveries.packet[_not_excluded(app)]
    arrived = np.bincount(promised, minlength=len(app.sent)).tolist()
    missing = [
        max(0, sent.targets - count) if sent.bound_ns is not None and sent.born_ns + sent.bound_ns < ended_ns else 0
        for sent, count in zip(app.sent.values(), arrived, strict=True)
    ]
    return np.array(missing, dtype=np.int64)


def _overtaken(app: AppPackets, surprises: Sequence[Span]) -> npt.NDArray[np.bool_]:
    """Of each packet with a bound, whether a fault overtook it: others are not asked for."""
    born_ns = np.array([sent.born_ns for sent in app.sent.values()], dtype=np.int64)
    over_ns = born_ns + np.array(_bounds_ns(app), dtype=np.int64)
    found = np.zeros(len(app.sent), dtype=np.bool_)
    for since_ns, until_ns in surprises:
        found |= (born_ns <= until_ns) & (over_ns >= since_ns)
    return found


def _bounds_ns(app: AppPackets) -> list[int]:
    """The bound of each packet; -1 for one without."""
    return [-1 if sent.bound_ns is None else sent.bound_ns for sent in app.sent.values()]


def delays_under_bound(app: AppPackets) -> tuple[Column, Column]:
    """The delays of all deliveries for which a bound was stated, and those bounds."""
    delays_ns, bounds_ns = _beside(app, _bounds_ns(app))
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
