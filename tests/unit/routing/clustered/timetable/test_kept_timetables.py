"""All nodes of a swarm compute the same timetable, also where they run another release: what it comes to is kept."""

import json
import math
import random
import zlib
from collections.abc import Callable, Mapping
from typing import Any

import pytest

from fanet_mw.routing.clustered.roles.position_updates import STRAYED, UNLIKE
from fanet_mw.routing.clustered.timetable.node_timetable import FittedTimetable
from fanet_mw.routing.clustered.timetable.turn_allocation import fit, fit_measured, least_interval_ns
from fanet_mw.routing.clustered.timetable.turn_size import links, schedule_parts, superframe
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, NodeId
from fanet_mw.wire.links import Link, grade_of

MakeScenario = Callable[..., Scenario]
LEADER = NodeId(1)
LOADS = {NodeId(3): 1500, NodeId(7): 50}
SMALL = {"traffic.payload_bytes": 200}
HEARD = {"clusters.load": "heard"}
SLACK = {"clusters.turn_slack_us": 400, "radio.lead_ms": 4}
TO_ONE = {"traffic.sources": 14, "traffic.destination": 4}
SHORT = {"clusters.flooding_period_s": 0.1}


def places_of(count: int, gap_m: float = 200) -> tuple[tuple[NodeId, Enu], ...]:
    """A crooked grid, four nodes wide."""
    drawn = random.Random(3)

    def along(step: int) -> float:
        return gap_m * (step + 0.2 * drawn.random())

    return tuple((NodeId(n + 1), Enu(along(n % 4), along(n // 4), 50.0)) for n in range(count))


def scenario_of(make_scenario: MakeScenario, interval_s: float, keys: Mapping[str, Any], count: int = 16) -> Scenario:
    common = {"clusters.relay": "scheduled", "clusters.flooding_period_s": 0.5, "radio.range_m": 250}
    common |= {"nodes.count": count, "traffic.sources": count - 1, "traffic.payload_bytes": 1024}
    return make_scenario(**common | {"traffic.interval_s": interval_s} | keys)


def heads_of(count: int, every: int) -> dict[NodeId, NodeId]:
    """All but the leader, led by each `every`-th."""
    heads = range(every, count + 1, every)
    return {NodeId(n): NodeId(min(heads, key=lambda head: (abs(head - n), head))) for n in range(2, count + 1)}


def told(found: FittedTimetable | None) -> str:
    """What a timetable comes to, in a line."""
    if found is None:
        return "none"
    turns, table, together, frame_bytes, whole, enough, odds, _ = found
    parts = (table.spans, table.uncovered, table.calls, table.hops, table.spare, table.near)
    missed = {root: [round(share, 3) for share in shares] for root, shares in (odds.missed if odds else {}).items()}
    everything = [
        turns,
        table.turns,
        table.used,
        table.sure,
        table.crowd,
        *(sorted(p.items()) for p in (*parts, missed)),
    ]
    digest = zlib.crc32(json.dumps(everything, default=sorted).encode())
    marks = "".join(mark for mark, there in (("heads ", not whole), ("scarce ", not enough)) if there)
    roots = f"{len(table.roots())} roots by {together}" if together > 1 else f"{len(table.roots())} roots"
    return f"{table.used} of {turns.per_superframe} turns of {frame_bytes} B, {roots}, {marks}{digest:08x}"


@pytest.mark.parametrize(
    ("interval_s", "keys", "every", "loads", "kept"),
    [
        (1.0, {}, 1, {}, "196 of 269 turns of 1024 B, 32 roots, 2ac1b458"),
        (0.25, {}, 1, {}, "258 of 269 turns of 1024 B, 46 roots, 4a69cb16"),
        (0.1, {}, 1, {}, "269 of 269 turns of 1024 B, 91 roots, 05142725"),
        (0.06, SMALL, 1, {}, "347 of 349 turns of 491 B, 76 roots by 2, e973fa91"),
        (0.04, SMALL, 1, {}, "349 of 349 turns of 491 B, 106 roots by 2, ace7f36c"),
        (0.03, {}, 1, {}, "187 of 187 turns of 2048 B, 69 roots by 2, scarce 6addc898"),
        (0.03, {"traffic.sources": 16}, 1, {}, "187 of 187 turns of 2048 B, 70 roots by 2, scarce ea7df517"),
        (
            0.03,
            {"traffic.sources": 14, "traffic.destination": 4},
            1,
            {},
            "187 of 187 turns of 2048 B, 69 roots by 2, scarce 6addc898",
        ),
        (0.3, {}, 4, {}, "192 of 269 turns of 1024 B, 31 roots, 1cd24351"),
        (0.1, SHORT, 4, {}, "35 of 35 turns of 1024 B, 5 roots, heads scarce 84cb628c"),
        (0.1, SHORT, 6, {}, "19 of 35 turns of 1024 B, 3 roots, heads scarce bc8fb7de"),
        (0.1, {"clusters.flooding_period_s": 0.06}, 4, {}, "none"),
        (
            0.2,
            SLACK,
            3,
            {},
            "219 of 223 turns of 1024 B, 46 roots, a5936f12",
        ),
        (0.2, HEARD, 1, LOADS, "266 of 269 turns of 1024 B, 55 roots, 71da7ba8"),
        (0.1, HEARD, 1, LOADS, "269 of 269 turns of 1024 B, 97 roots, 6d210034"),
        (0.05, HEARD | SMALL, 1, LOADS, "323 of 326 turns of 617 B, 71 roots by 2, dc25b283"),
        (0.05, HEARD | SMALL, 2, {**LOADS, LEADER: 100}, "324 of 326 turns of 617 B, 71 roots by 2, 0112c504"),
        (0.03, HEARD, 1, LOADS, "187 of 187 turns of 2048 B, 58 roots by 2, scarce b2389b26"),
        (0.1, HEARD | SHORT, 4, LOADS, "35 of 35 turns of 1024 B, 5 roots, heads scarce 84cb628c"),
    ],
)
def test_a_timetable_comes_to_what_it_came_to_before(
    make_scenario: MakeScenario,
    interval_s: float,
    keys: dict[str, Any],
    every: int,
    loads: dict[NodeId, int],
    kept: str,
) -> None:
    scenario = scenario_of(make_scenario, interval_s, keys)
    places = places_of(16)
    found = fit(scenario, places, heads_of(16, every), loads=loads)
    assert told(found) == kept, "on purpose? UAVs of two releases then disagree about turns: say so in the changelog"
    quick = fit(scenario, places, heads_of(16, every), loads=loads, quick=True)
    assert quick is None or quick.enough


def measured(places: tuple[tuple[NodeId, Enu], ...], reach_m: float) -> tuple[Link, ...]:
    """Links that lose more the longer they are: half of the frames at `reach_m`."""
    at = dict(places)
    pairs = [(a, b, math.dist(at[a], at[b])) for a in at for b in at if a < b]
    return tuple(
        Link(a, b, grade_of(0.5 ** ((length_m / reach_m) ** 3)), round(-40 - 30 * math.log10(length_m)))
        for a, b, length_m in pairs
        if length_m < 1.2 * reach_m
    )


@pytest.mark.parametrize(
    ("interval_s", "keys", "count", "gap_m", "kept"),
    [
        (2.0, {}, 8, 200, "176 of 971 turns of 1024 B, 9 roots, 238a8e47"),
        (1.0, {}, 8, 240, "216 of 485 turns of 1024 B, 9 roots, 40e7a574"),
        (0.5, {}, 8, 200, "240 of 269 turns of 1024 B, 16 roots, 4381be46"),
        (0.2, {}, 8, 220, "261 of 269 turns of 1024 B, 23 roots, 91fb6842"),
        (0.8, {}, 16, 180, "380 of 388 turns of 1024 B, 17 roots, 3e610185"),
        (1.0, SMALL, 12, 80, "111 of 629 turns of 491 B, 13 roots, 28e25bf9"),
        (0.5, SMALL, 20, 80, "327 of 349 turns of 491 B, 40 roots, 32bb501a"),
        (2.0, SMALL, 24, 180, "1135 of 1258 turns of 491 B, 25 roots, e5b139a5"),
        (1.5, SMALL, 20, 240, "942 of 943 turns of 491 B, 21 roots, 8ce92a22"),
        (0.4, SMALL | {"radio.lead_ms": 4}, 12, 220, "348 of 349 turns of 491 B, 24 roots, a3a8e535"),
        (0.05, {}, 12, 250, "none"),
    ],
)
def test_a_timetable_by_measured_links_comes_to_what_it_came_to_before(
    make_scenario: MakeScenario, interval_s: float, keys: dict[str, Any], count: int, gap_m: float, kept: str
) -> None:
    scenario = scenario_of(make_scenario, interval_s, keys | {"radio.channel": "log_distance"}, count)
    places = places_of(count, gap_m)
    links = measured(places, 280)
    assert told(fit_measured(scenario, places, links, leader=LEADER, origin_ns=0, link_parts=1)) == kept


@pytest.mark.parametrize(
    ("interval_s", "keys", "every", "kept_ms"),
    [
        (1.0, {}, 1, 250.0),
        (0.1, SMALL, 4, 27.78),
        (0.1, SMALL | SHORT, 4, 0.0),
        (0.2, HEARD, 2, 83.33),
        (0.1, {"traffic.sources": [2, 3, 5]}, 1, 50.0),
        (0.1, SMALL | {"radio.max_frame_bytes": 1000}, 3, 41.67),
    ],
)
def test_the_least_interval_is_what_it_was_before(
    make_scenario: MakeScenario, interval_s: float, keys: dict[str, Any], every: int, kept_ms: float
) -> None:
    scenario = scenario_of(make_scenario, interval_s, keys)
    found_ns = least_interval_ns(scenario, places_of(16), heads_of(16, every))
    assert round((found_ns or 0) / MS, 2) == kept_ms


@pytest.mark.parametrize(("count", "parts"), [(2, 1), (57, 1), (58, 2), (113, 2), (114, 3)])
def test_a_schedule_has_a_part_for_each_56_nodes_without_the_leader(
    make_scenario: MakeScenario, count: int, parts: int
) -> None:
    assert schedule_parts(scenario_of(make_scenario, 1.0, {}, count)) == parts


@pytest.mark.parametrize(
    ("model", "link_m", "farther_m"),
    [
        ("static", 0, 0),
        ("formation", 0, 2 * UNLIKE * 250),
        ("random_waypoint", 0, 2 * STRAYED * 250),
        ("formation", 200, 2 * UNLIKE * 200),
        ("random_waypoint", 200, 2 * STRAYED * 200),
    ],
)
def test_who_moves_may_disturb_others_as_much_farther_as_both_may_have_strayed(
    make_scenario: MakeScenario, model: str, link_m: float, farther_m: float
) -> None:
    keys = {"clusters.link_m": link_m, "world.gps_sigma_m": 0, "sensors.gps_bias_m": 0.5}
    scenario = scenario_of(make_scenario, 1.0, keys | {"mobility.model": model, "mobility.speed_m_s": 10})
    error_m = 4 * math.sqrt(2) * 0.5 + 1.5
    found = links(scenario, superframe(scenario))
    assert found.interference_m == pytest.approx(250 + error_m + farther_m)
    assert (found.link_m, found.margin_m) == ((200, 0) if link_m else (250, 0.05 * 250))
