"""Draws settings at random, flies them, and looks for a bound that was stated and not kept.

    python tests/fuzz/promises.py 500 --seed 1

A line per setting that broke a promise; the exit status is 1 if one did. Drawn are the number of UAVs, their grid,
rates, loads, leads, protocols with bounds, motion to 20 m/s (none, formation, or random waypoints), clocks that
drift, long superframes that are nearly full, and one fault: a UAV that crashes, falls mute or deaf, or is started
anew, or an air that is cut in two. Packets that are made around a fault do not count: it may break any promise.
"""

import argparse
import random
import sys
import time
from typing import Any

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import config
from fanet_mw.trace import BoundExcludes, BoundStated, Delivered
from fanet_mw.units import S
from sim.results.files import finish
from sim.run.outcome import Outcome
from sim.run.virtual import simulate

_FAULT_S, _BEFORE_S, _LONGER_S = 12, 3, 10
_AFTER_S = 3
_SILENT_HELLOS = 5
"""With a timetable a loss is known after the silence of so many hellos, one in a superframe at most."""
_FALL_S = 4
"""A radio works until its UAV has fallen to the ground."""
_DURATION_S, _WARMUP_S, _DRAIN_S, _LIFETIME_S = 26, 8, 8, 8


def drawn(numbers: random.Random) -> dict[str, Any]:
    """The tables of one scenario."""
    count = numbers.randint(4, 28)
    payload = numbers.randint(64, 500)
    in_rounds = numbers.random() < 0.6
    model = numbers.choice(["static", "static", "formation", "random_waypoint"])
    standard, rate = numbers.choice([("b", 2), ("b", 5.5), ("b", 11), ("g", 6), ("g", 24), ("g", 54)])
    lead_ms = numbers.choice([0, 0, numbers.randint(5, 60)])
    tree: dict[str, Any] = {
        "name": "drawn", "seed": numbers.randint(1, 10**6), "duration_s": _DURATION_S, "warmup_s": _WARMUP_S,
        "drain_s": _DRAIN_S,
        "nodes": {
            "count": count, "layout": "grid", "columns": numbers.randint(1, count), "telemetry_hz": 0,
            "spacing_m": numbers.uniform(80, 235),
        },
        "traffic": {
            "payload_bytes": payload, "interval_s": numbers.uniform(0.7, 4), "sources": numbers.randint(1, count - 1),
            "arrivals": numbers.choice(["cbr", "poisson"]),
        },
        "radio": {
            "channel": "range", "range_m": 250, "cw_min": numbers.choice([7, 15]), "standard": standard,
            "rate_mbps": rate, "lead_ms": lead_ms, "handover_ms": lead_ms / 3,
        },
        "mobility": {"model": model, "speed_m_s": numbers.uniform(1, 20)},
        "world": {"area_m": numbers.uniform(200, 1000)},
    }  # fmt: skip
    if in_rounds:
        share = numbers.choice([0.0, 0.4, 0.7])
        tree["traffic"]["priority"] = "report"
        tree["routing"] = {"protocol": "rounds", "lifetime_s": _LIFETIME_S, "report_lifetime_s": _LIFETIME_S}
        tree["rounds"] = {"turn_bytes": payload + numbers.randint(200, 700), "bulk_share": share}
        if share and numbers.random() < 0.5:
            bulk = {"name": "bulk", "payload_bytes": 1024, "interval_s": numbers.uniform(0.1, 2), "sources": count - 1}
            tree["further_traffic"] = [bulk]
    else:
        tree["routing"] = {"protocol": "clustered", "lifetime_s": _LIFETIME_S}
        tree["clusters"] = {
            "relay": "scheduled", "count": count - 1, "flooding_period_s": numbers.uniform(0.3, 1.5), "guard_ms": 1,
        }  # fmt: skip
        if numbers.random() < 0.4:
            tree["clusters"] |= {"flooding_period_s": numbers.uniform(1.5, 4), "contention_ms": 20}
            tree["routing"]["hello_interval_s"] = numbers.uniform(0.5, 2)
            tree["traffic"]["interval_s"] = numbers.uniform(0.08, 0.5)
    if numbers.random() < 0.3:
        tree["clock"] = {"sync": "beacons", "offset_ms": numbers.uniform(0, 50), "drift_ppm": numbers.uniform(0, 20)}
        tree["rounds" if in_rounds else "clusters"]["turn_slack_us"] = 400
    if numbers.random() < 0.3:
        tree["duration_s"] += _LONGER_S
        node = numbers.randint(1, count)
        tree["faults"] = [numbers.choice([
            {"kind": "crash", "node": node}, {"kind": "mute", "node": node}, {"kind": "deaf", "node": node},
            {"kind": "stop", "node": node, "for_s": 3},
            {"kind": "partition", "nodes": numbers.sample(range(1, count + 1), count // 2), "for_s": 4},
        ]) | {"at_s": _FAULT_S}]  # fmt: skip
    return tree


def broken_pairs(outcome: Outcome, tree: dict[str, Any]) -> int:
    """The pairs of a packet with a bound and a node for which it was stated that has it later, or never."""
    lasts_s = max((fault.get("for_s", _FALL_S) for fault in tree.get("faults", [])), default=0)
    again_s = _FAULT_S + lasts_s + _AFTER_S
    if tree["routing"]["protocol"] == "clustered":
        hello_s = tree["routing"].get("hello_interval_s", 1)
        silent_s = _SILENT_HELLOS * max(hello_s, tree["clusters"]["flooding_period_s"])
        again_s += silent_s
        if any(fault["kind"] == "deaf" for fault in tree.get("faults", [])):
            again_s += silent_s  # it notices first, and stops using its turns; that is what others notice
    fault_ns = range(round((_FAULT_S - _BEFORE_S) * S), round(again_s * S))
    bounds = {(one.node, one.seq): one for one in outcome.records if type(one) is BoundStated}
    excluded = {(one.node, one.seq, one.other) for one in outcome.records if type(one) is BoundExcludes}
    in_time = {
        (one.origin, one.seq, one.node) for one in outcome.records
        if type(one) is Delivered and (stated := bounds.get((one.origin, one.seq)))
        and one.t_ns <= stated.t_ns + stated.bound_ns
    }  # fmt: skip
    return sum(
        (origin, seq, node) not in in_time and (origin, seq, node) not in excluded
        for (origin, seq), stated in bounds.items() if not tree.get("faults") or stated.t_ns not in fault_ns
        for node in range(1, tree["nodes"]["count"] + 1) if node != origin
    )  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("settings", type=int)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    flown = refused = deliveries = broken = 0
    stated: dict[str, list[float]] = {}
    began = time.monotonic()
    for number in range(options.settings):
        tree = drawn(random.Random(f"{options.seed}/{number}"))
        try:
            scenario = config.build(tree)
        except ConfigError:
            refused += 1
            continue
        outcome = simulate(scenario)
        bound = finish(outcome, out=None)["bound"]
        flown += 1
        deliveries += bound.get("deliveries") or 0
        kind = f"{tree['routing']['protocol']}, {tree['mobility']['model']}"
        stated.setdefault(kind, []).append(bound.get("stated_share") or 0.0)
        if pairs := broken_pairs(outcome, tree):
            broken += pairs
            print(f"setting {number} of seed {options.seed}: {pairs} pairs broken: {tree}", flush=True)
    shares = "; ".join(f"{kind}: {len(all_of)} flown, {sum(all_of) / len(all_of):.3f} of packets had a bound"
                       for kind, all_of in sorted(stated.items()))  # fmt: skip
    print(
        f"{flown} settings flown, {refused} refused, {deliveries:,} deliveries under a bound, {broken} pairs broken; "
        f"{shares}; {time.monotonic() - began:.0f} s"
    )
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
