"""Swarms that send otherwise than `[traffic]` says, with turns for what is heard (`clusters.load`)."""

from typing import Any

import air_attacks
import pytest
import scenario_draws
from attacker import Attacker

from fanet_mw.scenario import Traffic
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

GRID = [
    "nodes.count=12",
    "clusters.count=11",
    "traffic.sources=11",
    "duration_s=30",
    "warmup_s=5",
    "clusters.reassign_s=0",
]
MORE = Traffic(name="more", interval_s=0.04, payload_bytes=1000, arrivals="cbr", sources=(4, 9))
"""Twenty-five more packets a second of two nodes, for which no timetable by `[traffic]` has turns."""


def summary_of(*settings: str, more: bool) -> dict[str, Any]:
    scenario = catalog.find("clusters", [*GRID, *settings])
    return finish(simulate(scenario.model_copy(update={"further_traffic": (MORE,) if more else ()})), out=None)


def test_nodes_that_send_more_get_turns_for_it_and_their_bounds_hold() -> None:
    said = summary_of("clusters.load=scenario", more=True)
    heard = summary_of("clusters.load=heard", "duration_s=42", more=True)
    assert said["classes"]["more"]["pdr"] < 0.75, "the load that nobody was told of does not fit the turns"
    assert heard["classes"]["more"]["pdr"] > 0.99
    assert heard["pdr"] > 0.99
    assert heard["bound"]["violations"] == said["bound"]["violations"] == 0
    assert heard["bound"]["classes"]["more"]["stated_share"] > 0.1
    fits = said["bound"]["classes"]["more"]
    assert fits["stated_share"] == fits["within_share"] < 0.4, "what does not fit the turns is promised nothing"
    assert said["bound"]["classes"]["traffic"]["stated_share"] > 0.8


@pytest.mark.slow
def test_where_all_send_what_they_were_to_send_nothing_changes() -> None:
    said, heard = (summary_of(f"clusters.load={load}", more=False) for load in ("scenario", "heard"))
    assert heard["pdr"] == said["pdr"] == 1.0
    assert heard["bound"] == said["bound"]


def test_a_load_that_is_forged_takes_nothing_from_others() -> None:
    """Packets in the name of node 9, whose numbers leap by 90 a second, and sometimes by far more."""

    def leap(t_ns: int, index: int) -> bytes:
        leaps = 10_000 * (index // 40)
        return air_attacks.packet(
            air_attacks.wire.filler(100), by=air_attacks.EVIL, t_ns=t_ns, seq=1_000 + 45 * index + leaps, origin=9
        )

    scenario = air_attacks.scenario(
        "clusters.relay=scheduled", "clusters.load=heard", "clusters.flooding_period_s=0.5", "duration_s=36"
    )
    attacker = Attacker(air_attacks.EVIL, scenario.name, air_attacks.every(500, leap, end_s=32))
    reports: dict[str, Any] = {}
    summary = scenario_draws.run(scenario, limit_s=60, instead=[attacker], reports=reports)
    assert summary["frames"]["closes"]
    assert summary["bound"]["violations"] == 0
    assert summary["pdr"] > 0.97
    assert reports["agent-1"]["loads_refused"] > 0
