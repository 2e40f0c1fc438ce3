"""What `fanet top` shows, of states that were made by hand."""

from array import array

from kit import MakeScenario
from rich.console import Console

from fanet_mw.bus.link_stats import COUNTS, LinkStats
from fanet_mw.bus.messages import Poses
from fanet_mw.trace import Delivered, Dropped, FlightModeChanged, MissionModeChanged, RoleChanged
from fanet_mw.units import MS, S
from sim.cli.top import screen
from sim.observation.swarm_state import SwarmState


def links(rows: list[tuple[int, int, int, int]], t_ns: int) -> LinkStats:
    ends = array("H", (end for src, dst, _, _ in rows for end in (src, dst)))
    counts = array("I", (n for _, _, sent, had in rows for n in (had, sent - had, *[0] * (COUNTS - 2))))
    return LinkStats(t_ns, S, ends, counts, array("q", [0] * len(rows)))


def shown(state: SwarmState, now_ns: int, *, most: int = 20) -> list[str]:
    console = Console(width=150, force_terminal=False, no_color=True, markup=False)
    with console.capture() as capture:
        console.print(screen("swarm", state, now_ns, most=most))
    return capture.get().splitlines()


def swarm(make_scenario: MakeScenario) -> SwarmState:
    state = SwarmState(make_scenario(**{"nodes.count": 3, "duration_s": 60}))
    state.take_poses(Poses(9 * S, array("H", [1, 2, 3]), array("d", [0.0] * 18)))
    state.take_records([
        RoleChanged(9 * S, 1, "head", 0, 1), RoleChanged(9 * S, 2, "member", 0, 1),
        FlightModeChanged(9 * S, 2, "goto"), MissionModeChanged(9 * S, 2, "respond", 4),
        FlightModeChanged(9 * S, 3, "fallen"),
        Delivered(9 * S, 2, 1, 5, 20 * MS, 1), Dropped(9 * S, 2, "expired", 1, 6),
    ])  # fmt: skip
    state.take_links(links([(1, 2, 10, 9), (2, 1, 10, 8), (1, 3, 10, 9), (3, 1, 10, 2)], 9 * S))
    state.take_report("agent-2", {"kind": "agent", "node": 2, "waiting": 7}, t_ns=9 * S)
    return state


def test_a_line_per_uav_says_mode_head_neighbors_queue_and_when_it_was_heard(make_scenario: MakeScenario) -> None:
    lines = shown(swarm(make_scenario), 10 * S)
    assert lines[0].startswith("swarm 10 of 60 s, clock 1")
    assert lines[1].split() == ["UAV", "role", "head", "flight", "mission", "battery", "neighbors", "heard", "[s]",
                                "queue", "received", "dropped"]  # fmt: skip
    rows = [line.split() for line in lines[2:]]
    assert rows[1] == ["2", "member", "1", "goto", "respond", "4", "-", "1:", "1", "1.0", "7", "1", "1"]
    assert rows[0][:4] == ["1", "head", "1", "-"]
    assert rows[2][3] == "fallen"
    assert "none" in rows[2], "what it sends arrives, and it hears a fifth: no neighbor"


def test_where_there_is_no_room_those_who_hear_the_fewest_stay(make_scenario: MakeScenario) -> None:
    lines = shown(swarm(make_scenario), 10 * S, most=1)
    assert lines[2].split()[0] == "3"
    assert lines[3] == "2 more, which hear more others, are not shown"
