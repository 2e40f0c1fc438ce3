"""The delays of a run against the bounds that were promised: each packet's origin states one when it accepts the
packet.

    within_share = deliveries within the bound of their packet / (all packets x the nodes for which each was meant)

A packet that never arrives, that comes too late, or for which its origin promised nothing lowers the share; only one
that comes too late is a violation. The result is empty when no origin promised anything.
"""

from collections.abc import Mapping
from typing import Any

from fanet_mw.units import MS
from sim.results.packets import Application


def against_bounds(applications: Mapping[str, Application]) -> dict[str, Any]:
    """`bound` of `summary.json`: everything together, and by application."""
    promised = {name: app for name, app in applications.items() if _promises(app)}
    if not promised:
        return {}
    return {
        **_judged([app for app in applications.values() if app.sent]),
        "classes": {name: _judged([app]) for name, app in promised.items()},
    }


def likely(applications: Mapping[str, Application]) -> dict[str, Any]:
    """`likely` of `summary.json`: statements of (delay, share), compared with the copies of the packets they are about.

    within_share = deliveries within the delay stated for their packet / (packets with a statement x their targets)

    The result is empty when no origin stated any. The statement holds when `within_share` is at least `share`.
    """
    stated = [
        (app, name, sent.likely) for app in applications.values() for name, sent in app.sent.items() if sent.likely
    ]
    if not stated:
        return {}
    delays = {name: delay_ns for _, name, (delay_ns, _) in stated}
    within = sum(
        record.delay_ns <= delays.get((record.origin, record.seq), -1)
        for app in applications.values()
        for record in app.deliveries
    )
    wanted = sum(app.wanted / len(app.sent) for app, _, _ in stated)
    packets = sum(len(app.sent) for app in applications.values())
    return {
        "share": min(share for _, _, (_, share) in stated),
        "within_share": round(within / wanted, 6),
        "stated_share": round(len(stated) / packets, 6),
        "worst_ms": round(max(delays.values()) / MS, 3),
    }


def _promises(app: Application) -> bool:
    return any(sent.bound_ns is not None for sent in app.sent.values())


def _judged(apps: list[Application]) -> dict[str, Any]:
    bounds = [sent.bound_ns for app in apps for sent in app.sent.values()]
    stated = [bound_ns for bound_ns in bounds if bound_ns is not None]
    wanted = sum(app.wanted for app in apps)
    promised = [
        (record.delay_ns, bound_ns)
        for app in apps
        for record in app.deliveries
        if (bound_ns := app.sent[record.origin, record.seq].bound_ns) is not None
    ]
    within = sum(delay_ns <= bound_ns for delay_ns, bound_ns in promised)
    return {
        "within_share": round(within / wanted, 6) if wanted else None,
        "violations": len(promised) - within,
        "deliveries": len(promised),
        "stated_share": round(len(stated) / len(bounds), 6),
        "worst_ms": round(max(stated) / MS, 3),
        "observed_max_ms": round(max((delay_ns for delay_ns, _ in promised), default=0) / MS, 3),
    }
