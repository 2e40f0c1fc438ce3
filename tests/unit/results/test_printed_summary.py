"""What is printed of a summary: each figure in its place, each row only where there is something to tell."""

import io
from collections.abc import Mapping
from typing import Any

import pytest
from rich.console import Console

from fanet_mw.scenario import Scenario
from sim.results.metrics import summarize
from sim.results.outcome import Outcome
from sim.results.printed_summary import show

TRAFFIC = {
    "pdr": 0.9321, "generated": 11, "delivered": 12, "repeated": 13, "unknown": 14,
    "delay_ms": {"p50": 15.2, "p95": 16.4, "max": 17.4},
}  # fmt: skip
EVERYTHING: dict[str, Any] = {
    **TRAFFIC,
    "scenario": "hills", "mode": "realtime", "nodes": 21, "seed": 22,
    "duration_s": 24.0, "simulated_s": 23.0, "wall_s": 2.0,
    "paces": [{"time_scale": 0.8, "wall_s": 25}, {"time_scale": 0.5, "wall_s": 26}, {"time_scale": 0.4, "wall_s": 27}],
    "reports": {**TRAFFIC, "pdr": None, "repeated": 0, "unknown": 0},
    "warnings": {**TRAFFIC, "generated": 31, "delay_ms": {"p50": None}},
    "worst_nodes": [{"node": node, "pdr": 0.95 + node / 100} for node in range(1, 5)],
    "air": {"pdr": 0.3214, "busy": 0.3314, "throughput_mbps": 0.3414, "late_acks": 3512},
    "frames": {
        "sent": 41, "delivered": 42, "dropped": {"busy": 43, "collision": 44}, "in_flight": 45, "closes": False,
        "unaccounted": 46, "unasked": 47,
    },
    "bound": {"violations": 51, "within_share": 0.5214, "worst_ms": 53.4, "stated_share": 0.5414,
              "observed_max_ms": 55.4},
    "reachable": {
        "at rest": {"share": 0.6114, "pdr": 0.6214}, "in flight": {"share": 0.0, "pdr": None},
        "never": {"share": None, "pdr": None},
    },
    "likely": {"within_share": 0.6314, "share": 0.64, "worst_ms": 65.4, "stated_share": 0.6614},
    "clock": {
        "error_us": {"p50": 71.14, "p99": 72.14, "max": 73.14}, "bound_us": 74.14, "beyond_bound": 75, "jumps": 76,
        "without_time": 77,
    },
    "admission": {"deadline_ms": 81.4, "refused": 82, "nodes_without": 83, "lost": 84},
    "lateness": {"late_frames": 91, "frames": 92, "share": 0.9314, "limit": 0.9414, "max_ms": 95.14},
    "pauses": {"count": 101, "longest_ms": 102.4, "total_ms": 103.4},
    "mission": {
        "survivors": 111, "detected": 112, "approached": 113, "reached": 114, "confirmed": 115, "persons": 136,
        "persons_false": 117, "inside": 118, "inside_error_m": 119.4, "among": 120, "among_error_m": 121.4,
        "time_to_confirm_s": [1.0, 122.4], "confirmed_error_m": 123.14, "wait_s": {"p50": 124.4, "max": 125.4},
        "located_wait_s": {"p50": 126.4, "max": 127.4}, "post_knows_s": {"count": 128, "p50": 129.14, "max": 130.14},
        "post_connected": 0.1314, "mistaken": 132, "reopened": 133, "coverage": 0.1344, "photographed": 0.1354,
        "connected": 0.1364, "time_to_approach_s": [137.14, 138.14, 139.14, 140.14], "localization_error_m": 141.4,
        "collisions": 142,
    },
    "no_fly_entries": 151,
    "separation": {"least_m": 152.14, "losses": 153, "foreseen": 154, "told": 155},
    "trace_sha256": "0123456789abcdef" * 2,
    "heard": {"malformed": 3, "why": {"too long": 161, "no such node": 162}},
    "invalid_because": ["163 frames are late", "the world ended"],
    "processes": {"ended": []},
    "disturbance": {"late": {"value": 2, "limit": 3}, "pauses": {"value": 2, "limit": 1}},
}  # fmt: skip


def printed(summary: Mapping[str, Any]) -> list[str]:
    show(summary, console := Console(width=300, record=True, file=io.StringIO()))
    return [" ".join(line.split()) for line in console.export_text().splitlines() if line]


def rows(*path: str, **keys: Any) -> list[str]:
    """The printed rows that are others with these figures of a part of the summary."""
    changed = {**EVERYTHING}
    part = changed
    for name in path:
        part[name] = {**part[name]}
        part = part[name]
    part.update(keys)
    before = printed(EVERYTHING)
    return [line for line in printed(changed) if line not in before]


def test_who_let_the_clock_slow_down_is_not_told_to_do_so() -> None:
    *_, advice = rows(paces=[{"time_scale": 1, "wall_s": 25}])
    assert advice.endswith("or let the swarm's clock slow down: fanet launch --slow-down-to 0.1")
    assert printed(EVERYTHING)[-1].endswith("or let the swarm's clock begin slower: fanet launch --set time_scale=0.4")


def test_faults_that_parted_the_air_are_told_beside_the_share_by_distance() -> None:
    (said,) = rows("mission", connected_by_distance=0.9)
    assert said.endswith("connected by distance 90.0% of the time, 13.6% with partitions and jammed areas")


def test_all_that_there_is_to_tell_of_a_run() -> None:
    assert printed(EVERYTHING) == [
        "hills, 21 nodes, seed 22, real processes, swarm clock at 0.8 for 25 s, slower for 53 s (at least 0.4): "
        "partial, 23 of 24 s in 2.0 s (11.5 x real time)",
        "traffic 93.2% delivered (11 packets, 12 deliveries, 13 more repeated after a restart, 14 of packets that "
        "nobody sent), delay p50 15 ms, p95 16 ms, max 17 ms",
        "survivor reports - delivered (11 packets, 12 deliveries), delay p50 15 ms, p95 16 ms, max 17 ms",
        "warnings 93.2% delivered (31 packets, 12 deliveries, 13 more repeated after a restart, 14 of packets "
        "that nobody sent)",
        "worst receivers node 1 96.0%, node 2 97.0%, node 3 98.0%",
        "air 32.1% of copies received, busy 33.1%, 0.341 Mb/s",
        "frames 41 sent = 42 delivered + 87 dropped + 45 in flight (DOES NOT CLOSE: 46 unaccounted for, 47 that "
        "nobody asked for; drops: busy 43, collision 44)",
        "bound 52.14% of packets x targets within it; at most 53 ms, stated for 54.1% of the packets; worst seen "
        "55 ms, broken 51 times",
        "reachable 62.14% of 61.1% in reach (at rest), nobody (in flight)",
        "likely 63.14% of the copies within what was stated for 64% of them: at most 65 ms, for 66.1% of the packets",
        "clocks off by p50 71.1 us, p99 72.1 us, max 73.1 us, stated at most 74.1 us, exceeded 75 times; 76 jumps "
        "of clocks seen and taken out; 77 nodes have no swarm time at the end",
        "deadline 81 ms: 82 packets refused; the bounds of 83 nodes do not meet it (lost 84 times)",
        "lateness 91 of 92 frames late (93.14%, limit 94.1%), worst 95.1 ms",
        "pauses 101 times this machine stood still for a while: 102 ms at most, 103 ms together",
        "survivors 112 of 111 detected, 113 approached, 114 reached",
        "confirmed 115, the last after 122 s, median error 123.1 m",
        "persons 21 more whose phone has no name, 117 finds of nobody else",
        "inside 118 in buildings, median error 119 m",
        "among 120 each one of several people, median error 121 m",
        "waited from heard to found: median 124 s, longest 125 s; once located: 126 s, 127 s",
        "post knows of 128 of 115, median 129.1 s after the confirmation, longest 130.1 s; connected with all "
        "13.1% of the time",
        "mistaken 132 taken for somebody else, 133 taken back",
        "search 13.4% of the area covered by phones, 13.5% by cameras, connected by distance 13.6% of the time",
        "approach 4 UAVs, first after 137.1 s, half after 139.1 s",
        "localization median error 141 m",
        "collisions 142",
        "no-fly areas entered 151 times",
        "separation least 152.1 m, lost 153 times",
        "conflicts foreseen 154 times, 155 of them by the other UAV alone",
        "trace 0123456789abcdef",
        "Heard on the bus and refused: too long 161, no such node 162",
        "3,512 acknowledgments came after the timeout: some links are longer than radio.coverage_class allows for "
        "(3 km, or 1.35 km with short slots; 450 m more per class)",
        "NOT VALID: 163 frames are late",
        "NOT VALID: the world ended",
        "This machine could not hold real time. Lower the load, raise radio.lead_ms, or let the swarm's clock "
        "begin slower: fanet launch --set time_scale=0.4",
    ]


def test_of_a_run_in_which_nothing_happened_four_rows_are_printed(make_scenario: Any) -> None:
    scenario: Scenario = make_scenario(**{"nodes.count": 3, "duration_s": 7})
    summary = summarize(Outcome(scenario, "virtual", 0.0, [], {}), trace_sha256="ab" * 9)
    assert [line.split(" ")[0] for line in printed({**summary, "invalid_because": []})] == [
        f"{scenario.name},", "traffic", "frames", "trace",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("path", "keys", "said"),
    [
        ([], {"wall_s": 0.0}, ["partial, 23 of 24 s in 0.0 s (0.0 x real time)"]),
        ([], {"simulated_s": 24.0}, ["(at least 0.4): 24 s in 2.0 s"]),
        ([], {"simulated_s": 24.123, "duration_s": 24.1234567}, ["(at least 0.4): 24.1235 s in 2.0 s"]),
        ([], {"paces": [{"time_scale": 0.8, "wall_s": 25}], "disturbance": {}}, ["swarm clock at 0.8: partial"]),
        ([], {"paces": [{"time_scale": 1, "wall_s": 25}], "disturbance": {}}, ["seed 22, real processes: partial"]),
        ([], {"mode": "virtual"}, ["seed 22, virtual time, swarm"]),
        ([], {"worst_nodes": [{"node": 8, "pdr": 0.9989}]}, ["worst receivers node 8 99.9%"]),
        ([], {"worst_nodes": [{"node": 8, "pdr": 0.999}]}, []),
        (["frames"], {"closes": True, "dropped": {}}, ["+ 0 dropped + 45 in flight (closes; drops: none)"]),
        (["air"], {"pdr": None, "late_acks": 0}, ["air - of copies received"]),
        (["bound"], {"violations": 0, "within_share": None}, ["bound - of packets", "never broken"]),
        (["bound"], {"violations": 9, "overtaken": 9}, ["never broken, overtaken by a fault 9 times"]),
        (["bound"], {"violations": 9, "overtaken": 2}, ["broken 7 times, overtaken by a fault 2 times"]),
        (["likely"], {"within_share": None}, ["likely - of the copies"]),
        (["reachable"], {"at rest": {"share": 1.0, "pdr": 1.0}}, ["reachable 100.00% of 100.0% in reach (at rest)"]),
        ([], {"reachable": {"at rest": {"share": 1.0, "pdr": 1.0}}}, []),
        (["clock"], {"bound_us": None, "jumps": 0, "without_time": 0}, ["max 73.1 us"]),
        (["clock"], {"error_us": {"p50": None}}, []),
        (["pauses"], {"count": 0}, []),
        (["mission"], {"persons": 115, "persons_false": 0}, []),
        (["mission"], {"persons": 115}, ["persons 0 more whose phone has no name, 117 finds"]),
        (["mission"], {"persons": 116, "persons_false": 0}, ["persons 1 more whose phone has no name, 0 finds"]),
        (["mission"], {"mistaken": 0}, ["mistaken 0 taken for somebody else, 133"]),
        (["mission"], {"mistaken": 0, "reopened": 0}, []),
        (["mission"], {"photographed": None}, ["13.4% of the area covered, connected"]),
        (["mission"], {"located_wait_s": {"p50": None}}, ["longest 125 s"]),
        (["mission"], {"survivors": 0}, []),
        (["separation"], {"foreseen": 0}, []),
        (["separation"], {"least_m": None}, []),
        (["heard"], {"malformed": 0}, []),
        ([], {"disturbance": {"late": {"value": 3, "limit": 3}}}, []),
        ([], {"processes": {"ended": [{"name": "emulator", "exit_code": -9}]}}, []),
    ],
)  # fmt: skip
def test_a_row_says_no_more_than_there_is(path: list[str], keys: dict[str, Any], said: list[str]) -> None:
    changed = rows(*path, **keys)
    assert len(changed) == bool(said)
    assert all(words in changed[0] for words in said)


def test_a_row_that_has_nothing_to_tell_is_left_out() -> None:
    without = {
        **EVERYTHING, "worst_nodes": [],
        "reports": {**TRAFFIC, "generated": 0}, "warnings": {**TRAFFIC, "generated": 0},
        "air": {}, "bound": {}, "reachable": {}, "likely": {}, "clock": {}, "admission": {}, "mode": "virtual",
        "pauses": {}, "no_fly_entries": 0, "separation": {}, "heard": {}, "invalid_because": [], "disturbance": {},
        "mission": {"survivors": 0, "collisions": 0},
    }  # fmt: skip
    assert [line.split(" ")[0] for line in printed(without)] == ["hills,", "traffic", "frames", "trace"]
