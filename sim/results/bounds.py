"""Compares delays with the bounds that were promised: each packet's origin states one when it accepts the packet.

    within_share = deliveries within the bound of their packet / (all packets x the nodes for which each was meant)

A promise is broken at each target at which a packet with a bound arrives too late, or never, if the bound was over
before the run. It is overtaken by a fault that begins before the bound is over, and by one that has begun so lately
that its origin need not know of it; the line of a partition and a jammed area surprise whoever flies there until they
end. Packets of users' applications, whose targets the trace does not tell, are in no share.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from fanet_mw.trace import RadioFault
from fanet_mw.units import MS, S
from sim.records.record_kinds import Column
from sim.results.packets import AppPackets

UNNOTICED_NS: Final = 4 * S
"""For so long after a fault has begun a bound may count on a link or node that is gone."""
_OF_PLACES: Final = ("partition", "jam")
"""Faults that UAVs fly into as long as they last."""

Span = tuple[int, int]
"""The first and the last instant of a time."""


class _Held(NamedTuple):
    """The bounds of one application's packets, compared with its deliveries."""

    app: AppPackets
    stated_ns: list[int]
    """The bounds that were stated."""
    delays_ns: Column
    """The delays of all deliveries for which a bound was stated."""
    late: int
    """How many of these exceed the bound."""
    never: int
    """How many more deliveries had not come when the bound was over."""
    overtaken: int
    """How many of all these a fault excuses."""


def against_bounds(
    applications: Mapping[str, AppPackets], faults: Iterable[RadioFault], *, ended_ns: int
) -> dict[str, Any]:
    """The table `bound` of `summary.json`, for all applications together and for each."""
    if not any(_promises(app) for app in applications.values()):
        return {}
    surprises = _surprises([*faults], ended_ns)
    held = {name: _held(app, surprises, ended_ns) for name, app in applications.items() if app.sent}
    return {
        **_summed_up(held.values()),
        "classes": {name: _summed_up([one]) for name, one in held.items() if one.stated_ns},
    }


def broken(bound: Mapping[str, Any]) -> int:
    """How many times a bound of a table `bound` did not hold without a fault that excuses it."""
    return int(bound.get("violations", 0)) - int(bound.get("overtaken", 0))


def _surprises(faults: Sequence[RadioFault], ended_ns: int) -> list[Span]:
    """For each fault the time in which not every node need know of it."""
    spans = []
    for number, fault in enumerate(faults):
        if fault.active:
            until_ns = fault.t_ns + UNNOTICED_NS
            if fault.kind in _OF_PLACES:
                ends_ns = (later.t_ns for later in faults[number + 1 :] if later.label == fault.label)
                until_ns = max(until_ns, next(ends_ns, ended_ns))
            spans.append((fault.t_ns, until_ns))
    return spans


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
        limits_ns = np.array([sent.likely[0] if sent.likely else -1 for sent in app.sent.values()], dtype=np.int64)
        in_time = app.deliveries.delay_ns <= limits_ns[app.deliveries.packet]
        within += int(in_time[_not_excluded(app)].sum()) if app.wanted else 0
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


def _held(app: AppPackets, surprises: Sequence[Span], ended_ns: int) -> _Held:
    born_ns, targets = np.array([(sent.born_ns, sent.targets) for sent in app.sent.values()], dtype=np.int64).T
    bounds_ns = _bounds_ns(app)
    over_ns = born_ns + bounds_ns
    packets, delays_ns, limits_ns = deliveries_under_bound(app)
    late = np.bincount(packets[delays_ns > limits_ns], minlength=len(app.sent))
    missing = np.maximum(0, targets - np.bincount(packets, minlength=len(app.sent)))
    missing[(bounds_ns < 0) | (over_ns >= ended_ns)] = 0
    overtaken = np.zeros(len(app.sent), dtype=np.bool_)
    for since_ns, until_ns in surprises:
        overtaken |= (born_ns <= until_ns) & (over_ns >= since_ns)
    excused = (late + missing)[overtaken].sum()
    return _Held(app, bounds_ns[bounds_ns >= 0].tolist(), delays_ns, int(late.sum()), int(missing.sum()), int(excused))


def _summed_up(many: Collection[_Held]) -> dict[str, Any]:
    stated_ns = [bound_ns for one in many for bound_ns in one.stated_ns]
    wanted = sum(one.app.wanted for one in many)
    in_time = sum(len(one.delays_ns) - one.late for one in many if one.app.wanted)
    never = sum(one.never for one in many)
    return {
        "within_share": round(in_time / wanted, 6) if wanted else None,
        "violations": sum(one.late for one in many) + never,
        "never": never,
        "overtaken": sum(one.overtaken for one in many),
        "deliveries": sum(len(one.delays_ns) for one in many),
        "stated_share": round(len(stated_ns) / sum(len(one.app.sent) for one in many), 6),
        "worst_ms": round(max(stated_ns) / MS, 3),
        "observed_max_ms": round(max(int(one.delays_ns.max(initial=0)) for one in many) / MS, 3),
    }


def _bounds_ns(app: AppPackets) -> Column:
    """The bound of each packet; -1 for one without."""
    return np.array([-1 if sent.bound_ns is None else sent.bound_ns for sent in app.sent.values()], dtype=np.int64)


def deliveries_under_bound(app: AppPackets) -> tuple[Column, Column, Column]:
    """The deliveries for which a bound was stated: the numbers of their packets, their delays, and those bounds."""
    deliveries = app.deliveries
    bounds_ns = _bounds_ns(app)[deliveries.packet]
    promised = (bounds_ns >= 0) & _not_excluded(app)
    return deliveries.packet[promised], deliveries.delay_ns[promised], bounds_ns[promised]


def _not_excluded(app: AppPackets) -> npt.NDArray[np.bool_]:
    """For each delivery, whether the packet's bound was stated for the node."""
    pairs = [
        number << 16 | node for number, sent in enumerate(app.sent.values()) if sent.excluded for node in sent.excluded
    ]
    return ~np.isin(app.deliveries.packet.astype(np.int64) << 16 | app.deliveries.node, np.array(pairs, np.int64))
