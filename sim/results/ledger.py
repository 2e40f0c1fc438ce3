"""The ledger: each frame is counted by the node that requests it and by the medium that transmits it, and each copy of
a frame at each receiver in range.

    frames    sent + unasked = delivered + dropped(reason) + in flight + unaccounted
    copies    on the air = received + lost(reason) + in flight;    in virtual time all handed over were heard

The ledger closes if nothing is unasked or unaccounted. A request of a node that did not reach the medium was lost on
the bus (reason `bus`). In virtual time the bus loses nothing, so such a request is unaccounted; so are the frames that
an emulator had when it died. `unasked` counts frames that the medium had of a node that never requested them.
"""

from collections import Counter
from collections.abc import Mapping
from typing import Any

from fanet_mw.errors import DropReason
from sim.results.outcome import Outcome

_NO_FRAMES: Mapping[str, Any] = {"sent": 0, "delivered": 0, "in_flight": 0, "dropped": {}}


def frames(outcome: Outcome) -> dict[str, Any]:
    """The table `frames` of `summary.json`."""
    emulator = outcome.reports.get("emulator", {})
    counted = emulator.get("frames", _NO_FRAMES)
    missing, unasked = _differences(outcome, emulator.get("requests", {}))
    dropped = Counter(counted["dropped"])
    unaccounted = 0
    if outcome.mode == "virtual":
        unaccounted = missing + dropped.pop(DropReason.BUS, 0)
    elif _cut_short(outcome, "emulator"):
        unaccounted = missing
    elif missing:
        dropped[DropReason.BUS] += missing
    sent = counted["sent"] + missing - unasked
    explained = counted["delivered"] + counted["in_flight"] + dropped.total()
    return {
        "sent": sent,
        "delivered": counted["delivered"],
        "in_flight": counted["in_flight"],
        "dropped": {reason: dropped[reason] for reason in sorted(dropped)},
        "unaccounted": unaccounted,
        "unasked": unasked,
        "closes": not unaccounted and not unasked and sent == explained,
    }


def _differences(outcome: Outcome, requests: Mapping[str, Mapping[str, int]]) -> tuple[int, int]:
    """The requests that did not reach the medium, and those that it had and no node made."""
    missing = unasked = 0
    for node in outcome.scenario.node_ids:
        name = f"agent-{node}"
        counts = requests.get(str(node), {})
        had = counts.get("all", 0)
        made = outcome.reports.get(name, {}).get("frames_sent", 0)
        restarted = outcome.mode == "realtime" and bool(outcome.scenario.planned_stops(node))
        if restarted or _cut_short(outcome, name):
            # the node's count ends before the node did, so the medium's count is used
            made = max(had, counts.get("before_restart", 0) + made)
        missing += max(0, made - had)
        unasked += max(0, had - made)
    return missing, unasked


def _cut_short(outcome: Outcome, name: str) -> bool:
    """True if the report of an actor does not cover all of its run."""
    report = outcome.reports.get(name)
    if report is None or any(ended == name for ended, _ in outcome.ended):
        return True
    return outcome.mode == "realtime" and not report.get("final")


def copies(outcome: Outcome) -> dict[str, Any]:
    """The table `copies` of `summary.json`: the ledger at the receivers, and how many copies reached the nodes."""
    emulator = outcome.reports.get("emulator", {})
    if not emulator:
        return {}
    agents = [report for report in outcome.reports.values() if report.get("kind") == "agent"]
    heard = sum(report["receptions"] for report in agents)
    counted, handed = emulator["copies"], sum(emulator["handed"].values())
    ended = counted["received"] + sum(counted["lost"].values()) + counted["in_flight"]
    all_lived = outcome.mode == "virtual" and not outcome.ended
    closes = counted["on_air"] == ended and (not all_lived or handed == heard)
    return {**counted, "handed": handed, "heard": heard, "closes": closes}
