"""Computes the summary of a run from its outcome. `summary_figures.toml` defines each figure."""

import math
from collections import Counter
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, Final

import numpy as np

from fanet_mw.errors import DropReason
from fanet_mw.trace import ConflictForeseen, DeadlineLost, DeadlineMet, Delivered, Dropped, RadioFault, Warned
from fanet_mw.units import MS, S
from sim.records.record_kinds import Column, records_of
from sim.results import ledger, validity
from sim.results.bounds import against_bounds, likely
from sim.results.clocks import clock_errors
from sim.results.clusters import clusters
from sim.results.links_over_time import LinksOverTime
from sim.results.mission import mission
from sim.results.outcome import Outcome
from sim.results.packets import OTHER_APPS, AppPackets, SentPacket, packets_of, targets_by_source
from sim.results.reachability import reachability
from sim.scenarios.notes import notes


def summarize(outcome: Outcome, *, trace_sha256: str) -> dict[str, Any]:
    """The content of `summary.json`."""
    scenario = outcome.scenario
    sent = packets_of(outcome)
    classes = [*scenario.traffic_classes]
    packets = _packets(outcome, sent)
    emulator = outcome.reports.get("emulator", {})
    frames, copies, lateness = ledger.frames(outcome), ledger.copies(outcome), _lateness(outcome, emulator)
    disturbance = validity.measures(outcome, frames=frames, late_share=lateness["share"])
    links = LinksOverTime(outcome)
    bound = against_bounds(sent, records_of(outcome.records, RadioFault), ended_ns=outcome.simulated_ns)
    clock = clock_errors(outcome)
    reasons = validity.reasons(outcome, frames=frames, copies=copies, bound=bound, clock=clock, disturbance=disturbance)
    return {
        "valid": not reasons,
        "invalid_because": reasons,
        "scenario": scenario.name,
        "seed": scenario.seed,
        "mode": outcome.mode,
        "nodes": scenario.nodes.count,
        "duration_s": scenario.duration_s,
        "notes": notes(scenario),
        "simulated_s": round(outcome.simulated_ns / S, 3),
        "time_scale": _last_scale(outcome),
        "slowed": [{"t_s": round(t_ns / S, 3), "time_scale": round(scale, 6)} for t_ns, scale in outcome.slowed],
        "paces": _paces(outcome),
        "pauses": dict(outcome.pauses),
        "leads": dict(outcome.leads),
        "wall_s": round(outcome.wall_s, 3),
        "epoch_unix_ns": outcome.epoch_unix_ns,
        **packets[classes[0]],
        "classes": {name: packets[name] for name in classes} if len(classes) > 1 else {},
        "reports": packets["report"],
        "warnings": packets["warning"],
        "applications": {name: part for name, part in packets.items() if name not in (*classes, *OTHER_APPS)},
        "messages": _messages(outcome),
        "frames": frames,
        "copies": copies,
        "air": emulator.get("air", {}),
        "lateness": lateness,
        "disturbance": {
            name: {"value": round(measure.value, 6), "limit": measure.limit} for name, measure in disturbance.items()
        },
        "bound": bound,
        "likely": likely(sent),
        "reachable": reachability(outcome, sent, links),
        "clusters": clusters(outcome, links),
        "clock": clock,
        "admission": _admission(outcome),
        "mission": mission(outcome.scenario, outcome.records),
        "no_fly_entries": outcome.reports.get("world", {}).get("no_fly_entries", 0),
        "separation": separation(outcome),
        "processes": {
            "ready_s": round(outcome.ready_s, 3),
            "ended": [{"name": name, "exit_code": code} for name, code in outcome.ended],
        },
        "heard": dict(outcome.heard),
        "absent": dict(outcome.absent),
        "aborted": outcome.aborted,
        "trace_sha256": trace_sha256,
    }


def _last_scale(outcome: Outcome) -> float | None:
    """The scale of the swarm's clock at the end; None in virtual time."""
    if outcome.mode == "virtual":
        return None
    return round(outcome.slowed[-1][1], 6) if outcome.slowed else outcome.scenario.time_scale


def _paces(outcome: Outcome) -> list[dict[str, float]]:
    """For how long the swarm's clock ran at which scale, the fastest first; empty in virtual time."""
    if outcome.mode == "virtual":
        return []
    changes = [(0, outcome.scenario.time_scale), *outcome.slowed, (outcome.simulated_ns, 0.0)]
    wall_s: dict[float, float] = {}
    for (since_ns, scale), (until_ns, _) in pairwise(changes):
        pace = round(scale, 6)  # the same one is reached by different sums
        wall_s[pace] = wall_s.get(pace, 0.0) + max(0, until_ns - since_ns) / scale / S
    return [{"time_scale": pace, "wall_s": round(wall_s[pace], 3)} for pace in sorted(wall_s, reverse=True)]


def _messages(outcome: Outcome) -> dict[str, int]:
    """The fates of the messages of users' applications, of all nodes together; empty if there were none."""
    total: Counter[str] = Counter()
    for report in outcome.reports.values():
        total.update(report.get("messages", {}))
    return dict(sorted(total.items()))


def _packets(outcome: Outcome, packets: Mapping[str, AppPackets]) -> dict[str, dict[str, Any]]:
    """The number of packets generated and delivered, the PDR and the delays of each application."""
    lead_ns = outcome.scenario.radio.lead_ns
    result: dict[str, dict[str, Any]] = {
        name: {
            "generated": len(app.sent),
            "delivered": app.deliveries.number,
            "repeated": app.repeated,
            "unknown": app.unknown,
            "pdr": _ratio(app.deliveries.number, app.wanted),
            "delay_ms": summed_up(app.deliveries.delay_ns),
            "delay_parts_ms": _delay_parts(app, lead_ns=lead_ns),
        }
        for name, app in packets.items()
    }
    first = next(iter(outcome.scenario.traffic_classes))
    traffic = packets[first]
    result[first]["worst_nodes"] = _worst_nodes(
        Counter(node for node, _ in traffic.sent),
        targets_by_source(outcome),
        Counter(traffic.deliveries.node.tolist()),
    )
    return result


def _worst_nodes(
    per_source: Counter[int], targets: Mapping[int, frozenset[int]], received: Counter[int], most: int = 5
) -> list[dict[str, Any]]:
    """The nodes that received the smallest share of the packets that were meant for them, the worst first."""
    wanted: Counter[int] = Counter()
    for source, packets in per_source.items():
        for node in targets[source]:
            wanted[node] += packets
    shares = sorted((received[node] / wanted[node], node) for node in wanted)
    return [{"node": node, "pdr": round(share, 4)} for share, node in shares[:most]]


def _ratio(part: float, whole: float) -> float | None:
    return round(part / whole, 6) if whole else None


def _lateness(outcome: Outcome, emulator: Mapping[str, Any]) -> dict[str, Any]:
    late = emulator.get("late", {})
    frames, late_frames = late.get("frames", 0), late.get("late_frames", 0)
    share = late_frames / frames if frames else 0.0
    return {
        "p50_ms": late.get("p50_ms", 0.0),
        "p99_ms": late.get("p99_ms", 0.0),
        "max_ms": late.get("max_ms", 0.0),
        "late_frames": late_frames,
        "frames": frames,
        "share": round(share, 6),
        "limit": outcome.scenario.radio.late_limit,
        "valid": outcome.mode == "virtual" or (share <= outcome.scenario.radio.late_limit and outcome.aborted is None),
    }


def _admission(outcome: Outcome) -> dict[str, Any]:
    """Packets refused, and how often nodes met or lost `traffic.deadline_s`; empty without that."""
    deadline_s = outcome.scenario.traffic.deadline_s
    if deadline_s is None:
        return {}
    said = [*records_of(outcome.records, DeadlineMet, DeadlineLost)]
    last = {record.node: isinstance(record, DeadlineMet) for record in said}
    reasons = (record.reason for record in records_of(outcome.records, Dropped))
    return {
        "deadline_ms": round(deadline_s * 1000, 3),
        "refused": sum(reason == DropReason.ADMISSION for reason in reasons),
        "lost": sum(isinstance(record, DeadlineLost) for record in said),
        "met": sum(isinstance(record, DeadlineMet) for record in said),
        "nodes_without": sum(not met for met in last.values()),
    }


def separation(outcome: Outcome) -> dict[str, Any]:
    """The true separation, and the conflicts that UAVs foresaw; empty if separation was not watched."""
    seen = outcome.reports.get("world", {}).get("separation")
    if not seen:
        return {}
    foreseen = [*records_of(outcome.records, ConflictForeseen)]
    about = {(r.node, r.seq): r.other for r in records_of(outcome.records, Warned)}
    delivered = records_of(outcome.records, Delivered) if about else ()
    delays_ms = [r.delay_ns / MS for r in delivered if about.get((r.origin, r.seq)) == r.node]
    ahead_s = sorted(r.closest_ms / 1000 for r in foreseen)
    return {
        **seen,
        "foreseen": len(foreseen),
        "told": sum(r.told for r in foreseen),
        "ahead_s": {"least": ahead_s[0], "p50": ahead_s[len(ahead_s) // 2]} if ahead_s else {},
        "warnings": len(about),
        "reached_the_other": round(len(delays_ms) / len(about), 6) if about else None,
        "to_the_other_ms": {
            "p50": round(float(np.percentile(delays_ms, 50)), 3),
            "p95": round(float(np.percentile(delays_ms, 95)), 3),
            "max": round(max(delays_ms), 3),
        } if delays_ms else {},
    }  # fmt: skip


PARTS: Final = ("lead", "queue", "air", "handover")


def summed_up(delays_ns: Column) -> dict[str, float | None]:
    """The mean, the percentiles and the maximum of some delays [ms]; None for each if there are no delays."""
    if not len(delays_ns):
        return dict.fromkeys(("mean", "p50", "p95", "p99", "max"))
    values = delays_ns.astype(np.float64) / MS
    p50, p95, p99 = np.percentile(values, (50, 95, 99))
    named = {"mean": values.mean(), "p50": p50, "p95": p95, "p99": p99, "max": values.max()}
    return {name: round(float(value), 3) for name, value in named.items()}


def _delay_parts(app: AppPackets, *, lead_ns: int) -> dict[str, float | None]:
    """The mean of each part of a delay [ms], over the deliveries of packets whose release is known.

    hand-over ......... release ......... end of the frame ......... receipt
    |  lead  |  queue  |      air, relays included      |  handover  |
    """
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
