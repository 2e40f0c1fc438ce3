"""From an outcome to the summary. Every definition is written in docs/experiments.md; nothing is measured twice.

pdr      = unique deliveries of application packets at their targets / (packets generated x targets), never above 1
repeated = further deliveries of a packet at a target that already had it: its process has started again
delay    = from the generation instant to the first reception, per (packet, target)
"""

import statistics
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from agents.traffic import targets_of
from fanet_mw.errors import DropReason
from fanet_mw.trace import (
    Approaching,
    Arrived,
    Collided,
    DeadlineLost,
    DeadlineMet,
    Delivered,
    Detected,
    Dropped,
    Generated,
)
from fanet_mw.units import MS, S
from sim import ledger
from sim.bounds import against_bounds
from sim.clocks import clock_errors
from sim.outcome import Outcome
from sim.separation import separation
from sim.survivors import place

_APPS: Final = ("traffic", "report", "warning")


def summarize(outcome: Outcome, *, trace_sha256: str) -> dict[str, Any]:
    """The content of `summary.json`."""
    scenario = outcome.scenario
    packets = _packets(outcome)
    emulator = outcome.reports.get("emulator", {})
    return {
        "scenario": scenario.name,
        "seed": scenario.seed,
        "mode": outcome.mode,
        "nodes": scenario.nodes.count,
        "duration_s": scenario.duration_s,
        "time_scale": scenario.time_scale if outcome.mode == "realtime" else None,
        "wall_s": round(outcome.wall_s, 3),
        **packets["traffic"],
        "reports": packets["report"],
        "warnings": packets["warning"],
        "frames": ledger.frames(outcome),
        "copies": ledger.copies(outcome),
        "air": emulator.get("air", {}),
        "lateness": _lateness(outcome, emulator),
        "bound": against_bounds(outcome),
        "clock": clock_errors(outcome),
        "admission": _admission(outcome),
        "mission": _mission(outcome),
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


def _packets(outcome: Outcome) -> dict[str, dict[str, Any]]:
    """Generated, delivered, PDR and delay of each application."""
    scenario = outcome.scenario
    app_of: dict[tuple[int, int], str] = {}
    generated: Counter[str] = Counter()
    wanted: Counter[str] = Counter()
    per_source: Counter[int] = Counter()
    targets = {node: frozenset(targets_of(scenario, node)) for node in scenario.node_ids}
    for record in outcome.records:
        if type(record) is Generated:
            app_of[record.node, record.seq] = record.app
            generated[record.app] += 1
            if record.app == "traffic":
                per_source[record.node] += 1
                wanted[record.app] += len(targets[record.node])
            else:
                wanted[record.app] += scenario.nodes.count - 1
    delays: dict[str, list[int]] = {app: [] for app in _APPS}
    repeated: Counter[str] = Counter()
    received: Counter[int] = Counter()
    had: set[tuple[int, int, int]] = set()
    for record in outcome.records:
        if type(record) is not Delivered:
            continue
        app = app_of.get((record.origin, record.seq))
        if app is None or not _is_target(record, app, targets):
            continue
        delivery = record.node, record.origin, record.seq
        if delivery in had:
            repeated[app] += 1
            continue
        had.add(delivery)
        delays[app].append(record.delay_ns)
        if app == "traffic":
            received[record.node] += 1
    result: dict[str, dict[str, Any]] = {
        app: {
            "generated": generated[app],
            "delivered": len(delays[app]),
            "repeated": repeated[app],
            "pdr": _ratio(len(delays[app]), wanted[app]),
            "delay_ms": _delay(delays[app]),
        }
        for app in _APPS
    }
    result["traffic"]["worst_nodes"] = _worst_nodes(per_source, targets, received)
    return result


def _is_target(delivered: Delivered, app: str, targets: Mapping[int, frozenset[int]]) -> bool:
    """Whether the packet was meant for this node; reports and warnings are meant for all but their origin."""
    if app == "traffic":
        return delivered.node in targets[delivered.origin]
    return delivered.node != delivered.origin


def _worst_nodes(
    per_source: Counter[int], targets: Mapping[int, frozenset[int]], received: Counter[int], most: int = 5
) -> list[dict[str, Any]]:
    """The nodes that received the least of what was meant for them, worst first."""
    wanted: Counter[int] = Counter()
    for source, packets in per_source.items():
        for node in targets[source]:
            wanted[node] += packets
    shares = sorted((received[node] / wanted[node], node) for node in wanted)
    return [{"node": node, "pdr": round(share, 4)} for share, node in shares[:most]]


def _ratio(part: float, whole: float) -> float | None:
    return round(part / whole, 6) if whole else None


def _delay(delays_ns: Sequence[int]) -> dict[str, float | None]:
    if not delays_ns:
        return dict.fromkeys(("mean", "p50", "p95", "p99", "max"))
    values = np.asarray(delays_ns, dtype=np.float64) / MS
    p50, p95, p99 = np.percentile(values, (50, 95, 99))
    named = {"mean": values.mean(), "p50": p50, "p95": p95, "p99": p99, "max": values.max()}
    return {name: round(float(value), 3) for name, value in named.items()}


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
    """What the nodes refused, and what they said of the deadline; empty without `traffic.deadline_s`."""
    deadline_s = outcome.scenario.traffic.deadline_s
    if deadline_s is None:
        return {}
    said = [record for record in outcome.records if isinstance(record, DeadlineMet | DeadlineLost)]
    last = {record.node: isinstance(record, DeadlineMet) for record in said}
    reasons = (record.reason for record in outcome.records if type(record) is Dropped)
    return {
        "deadline_ms": round(deadline_s * 1000, 3),
        "refused": sum(reason == DropReason.ADMISSION for reason in reasons),
        "lost": sum(isinstance(record, DeadlineLost) for record in said),
        "met": sum(isinstance(record, DeadlineMet) for record in said),
        "nodes_without": sum(not met for met in last.values()),
    }


def _mission(outcome: Outcome) -> dict[str, Any]:
    records, scenario = outcome.records, outcome.scenario
    first: dict[int, int] = {}
    errors: list[float] = []
    truth = place(scenario)
    for record in records:
        if type(record) is Approaching:
            first.setdefault(record.node, record.t_ns)
            at = truth[record.survivor - 1]
            errors.append(float(np.hypot(at.east - record.east_m, at.north - record.north_m)))
    return {
        "survivors": scenario.mission.survivors,
        "detected": len({r.survivor for r in records if type(r) is Detected}),
        "approached": len({r.survivor for r in records if type(r) is Approaching}),
        "reached": len({r.survivor for r in records if type(r) is Arrived}),
        "uavs_approaching": len(first),
        "time_to_approach_s": sorted(round(t_ns / S, 3) for t_ns in first.values()),
        "localization_error_m": round(statistics.median(errors), 1) if errors else None,
        "collisions": sum(1 for r in records if type(r) is Collided),
    }
