"""May a result be used? Every reason why not, alone, and the limits from both sides."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from agents.uav import Uav
from fanet_mw.bus.messages import Reception
from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, NodeId, S
from sim.results import validity
from sim.results.metrics import summarize
from sim.results.outcome import UNHEARD, Outcome
from sim.results.printed_summary import show
from sim.world.world import WorldActor

SENT = 4000
"""Requests of each of the two nodes."""
HEARD = 20_000
Change = Callable[[Outcome], object]


@pytest.fixture
def scenario(make_scenario: Any) -> Scenario:
    scenario: Scenario = make_scenario(**{"nodes.count": 2})
    return scenario


def agent(node: int) -> dict[str, Any]:
    return {
        "kind": "agent", "node": node, "final": True, "frames_sent": SENT, "receptions": HEARD, "heard_late": 0,
        "missed_turns": 0, "host": {"stall_ms": 3.0},
    }  # fmt: skip


def good(scenario: Scenario) -> Outcome:
    """A run in real time with which nothing is wrong."""
    total = 2 * SENT
    emulator = {
        "kind": "emulator", "final": True, "host": {"stall_ms": 2.0},
        "frames": {"sent": total, "delivered": total, "in_flight": 0, "dropped": {}},
        "requests": {str(node): {"all": SENT, "before_restart": 0} for node in (1, 2)},
        "copies": {"on_air": 2 * HEARD, "received": 2 * HEARD, "lost": {}, "in_flight": 0},
        "late": {"frames": total, "late_frames": 0}, "handed": {"1": HEARD, "2": HEARD},
    }  # fmt: skip
    world = {"kind": "world", "final": True, "ticks": 1000, "skipped_ticks": 0, "host": {"stall_ms": 1.0}}
    reports: dict[str, Any] = {"emulator": emulator, "world": world, "agent-1": agent(1), "agent-2": agent(2)}
    return Outcome(scenario, "realtime", 10.0, [], reports)


def reasons(outcome: Outcome) -> list[str]:
    summary = summarize(outcome, trace_sha256="")
    assert list(summary)[:2] == ["valid", "invalid_because"], "the first thing that anybody sees"
    assert summary["valid"] == (not summary["invalid_because"])
    found: list[str] = summary["invalid_because"]
    return found


def test_a_run_with_which_nothing_is_wrong_is_valid(scenario: Scenario) -> None:
    assert reasons(good(scenario)) == []


@pytest.mark.parametrize(("fate", "off"), [("received", -1), ("on_air", 1), ("in_flight", 1)])
def test_a_copy_without_a_fate_or_with_two_makes_a_run_invalid(scenario: Scenario, fate: str, off: int) -> None:
    outcome = good(scenario)
    outcome.reports["emulator"]["copies"][fate] += off
    (reason,) = reasons(outcome)
    assert "copies at receivers does not close" in reason


def put(outcome: Outcome, name: str, *path: str, value: object) -> None:
    content: Any = outcome.reports[name]
    for key in path[:-1]:
        content = content[key]
    content[path[-1]] = value


def lose_requests(outcome: Outcome, share: float, reason: str = "bus") -> None:
    lost = round(2 * SENT * share)
    put(outcome, "emulator", "frames", "dropped", value={reason: lost})
    put(outcome, "emulator", "frames", "delivered", value=2 * SENT - lost)


MEASURED: dict[str, tuple[float, Callable[[Outcome, float], object]]] = {
    "frames announced too late": (
        0.01, lambda outcome, share: put(outcome, "emulator", "late", "late_frames", value=round(share * 2 * SENT))
    ),
    "requests lost on the bus": (validity.LOST_LIMIT, lose_requests),
    "requests dropped as too late": (validity.LOST_LIMIT, lambda outcome, share: lose_requests(outcome, share, "late")),
    "receptions lost on the bus": (
        validity.LOST_LIMIT,
        lambda outcome, share: put(outcome, "agent-2", "receptions", value=HEARD - round(2 * HEARD * share)),
    ),
    "receptions handed over too late": (
        validity.HEARD_LATE_LIMIT,
        lambda outcome, share: put(outcome, "agent-1", "heard_late", value=round(2 * HEARD * share)),
    ),
    "turns missed, of all requests": (
        validity.LOST_LIMIT,
        lambda outcome, share: put(outcome, "agent-1", "missed_turns", value=round(2 * SENT * share)),
    ),
    "ticks that the world skipped": (
        validity.SKIPPED_TICKS_LIMIT,
        lambda outcome, share: put(outcome, "world", "skipped_ticks", value=round(1000 * share / (1 - share))),
    ),
    "longest standstill of a service": (
        validity.STALL_LIMIT_MS, lambda outcome, ms: put(outcome, "emulator", "host", "stall_ms", value=ms)
    ),
    "longest standstill of a UAV": (
        validity.UAV_STALL_LIMIT_MS, lambda outcome, ms: put(outcome, "agent-2", "host", "stall_ms", value=ms)
    ),
}  # fmt: skip


@pytest.mark.parametrize(("what", "limit", "disturb"), [(k, *v) for k, v in MEASURED.items()], ids=MEASURED.keys())
def test_each_measure_makes_a_run_invalid_above_its_limit_and_not_below(
    scenario: Scenario, what: str, limit: float, disturb: Callable[[Outcome, float], object]
) -> None:
    below, above = good(scenario), good(scenario)
    disturb(below, 0.9 * limit)
    disturb(above, 1.2 * limit)
    assert reasons(below) == []
    (why,) = reasons(above)
    assert why.startswith(what)
    assert "limit" in why
    disturbance = summarize(above, trace_sha256="")["disturbance"]
    assert [name for name, item in disturbance.items() if item["value"] > item["limit"]] != []


def test_what_is_lost_in_different_ways_adds_up(scenario: Scenario) -> None:
    """Each kind takes copies from those who wait for them: one half of the limit and one more is too much."""
    outcome = good(scenario)
    lose_requests(outcome, 0.6 * validity.LOST_LIMIT)
    put(outcome, "agent-1", "missed_turns", value=round(2 * SENT * 0.3 * validity.LOST_LIMIT))
    assert reasons(outcome) == []
    put(outcome, "agent-1", "missed_turns", value=round(2 * SENT * 0.6 * validity.LOST_LIMIT))
    assert reasons(outcome) == ["lost on the bus, dropped as too late and missed, together: 0.300%, limit 0.250%"]


BROKEN: dict[str, tuple[Change, str]] = {
    "a dead agent": (
        lambda outcome: outcome.ended.append(("agent-2", -9)),
        "agent-2 ended before the end, with signal SIGKILL: 1, limit 0",
    ),
    "a dead world": (
        lambda outcome: outcome.ended.append(("world", 1)),
        "world ended before the end, with exit code 1: 1, limit 0",
    ),
    "many dead agents": (
        lambda outcome: outcome.ended.extend([(f"agent-{node}", -15) for node in range(1, 10)]),
        "agent-1, agent-2, agent-3, agent-4, agent-5 and 4 more ended before the end, with signal SIGTERM: 9, limit 0",
    ),
    "aborted": (lambda outcome: setattr(outcome, "aborted", "interrupted"), "partial result: interrupted"),
    "no report": (
        lambda outcome: setattr(outcome, "absent", {"agent-99": "no report was heard"}),
        "no report of agent-99 (no report was heard); all must report",
    ),
    "too long a last report": (
        lambda outcome: (
            put(outcome, "agent-1", "final", value=False),
            setattr(outcome, "absent", {"agent-1": "of 9 MB"}),
        ),
        "no last report of agent-1 (of 9 MB); all must report",
    ),
    "no last report": (
        lambda outcome: put(outcome, "agent-1", "final", value=False), "no last report of agent-1: 1, limit 0"
    ),
    "unasked frames": (
        lambda outcome: put(outcome, "agent-1", "frames_sent", value=SENT - 3),
        "frames that no node asked for: 3, limit 0",
    ),
    "a lost trace": (
        lambda outcome: setattr(outcome, "heard", {"why": {"trace: disk": 7}}),
        "trace records or puts not kept (disk): 7, limit 0",
    ),
    "the launcher stood still": (
        lambda outcome: setattr(outcome, "stall_ms", 5200.0),
        "longest standstill of a service: 5200 ms (the launcher), limit 500 ms",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("change", "why"), BROKEN.values(), ids=BROKEN.keys())
def test_whatever_is_broken_makes_a_run_invalid_and_is_said(scenario: Scenario, change: Change, why: str) -> None:
    outcome = good(scenario)
    change(outcome)
    assert reasons(outcome) == [why]


def test_a_share_of_requests_is_at_most_all_of_them_whoever_made_them(scenario: Scenario) -> None:
    outcome = good(scenario)  # a liar in the name of node 1 skips numbers, so that most of its requests seem lost
    put(outcome, "emulator", "requests", "1", "all", value=11 * SENT)
    put(outcome, "emulator", "frames", value={
        "sent": 12 * SENT, "delivered": 3 * SENT, "in_flight": 0, "dropped": {"bus": 9 * SENT},
    })  # fmt: skip
    assert reasons(outcome) == [
        "frames that no node asked for: 40000, limit 0",
        "requests lost on the bus: 75.000%, limit 0.250%",
    ]


def test_frames_that_a_dead_emulator_took_with_it_are_said_besides_its_death(scenario: Scenario) -> None:
    outcome = good(scenario)
    outcome.ended.append(("emulator", -9))
    put(outcome, "emulator", "requests", "1", "all", value=SENT - 185)
    put(
        outcome,
        "emulator",
        "frames",
        value={"sent": 2 * SENT - 185, "delivered": 2 * SENT - 185, "in_flight": 0, "dropped": {}},
    )
    assert reasons(outcome) == [
        "emulator ended before the end, with signal SIGKILL: 1, limit 0",
        "frames unaccounted for: 185 of 8000, limit 0",
    ]


def test_a_run_in_virtual_time_is_judged_by_its_ledger_alone(scenario: Scenario) -> None:
    outcome = good(scenario)
    outcome.mode = "virtual"
    for name in outcome.reports:
        del outcome.reports[name]["final"], outcome.reports[name]["host"]  # type: ignore[attr-defined]
    assert reasons(outcome) == []
    put(outcome, "agent-1", "frames_sent", value=SENT + 1)
    assert reasons(outcome) == ["frames unaccounted for: 1 of 8001, limit 0"]


def test_every_reason_is_printed(scenario: Scenario, capsys: pytest.CaptureFixture[str]) -> None:
    from sim.console import Console

    outcome = good(scenario)
    outcome.ended.append(("agent-2", -9))
    put(outcome, "agent-1", "host", "stall_ms", value=1900.0)
    summary = summarize(outcome, trace_sha256="") | {"air": {}}
    show(summary, Console(width=200))
    printed = capsys.readouterr().out
    for reason in summary["invalid_because"]:
        assert f"NOT VALID: {reason}" in printed
    assert len(summary["invalid_because"]) == 2


# --- where the measures come from -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("after_ms", "late"), [(65, 0), (66, 1)])
def test_a_reception_is_late_beyond_a_handover_and_a_lead(make_scenario: Any, after_ms: int, late: int) -> None:
    scenario = make_scenario(**{"radio.handover_ms": 20, "radio.lead_ms": 45})
    uav = Uav(scenario, NodeId(1), "late", position=Enu(0, 0, 50))
    uav.start(0)
    uav.receive(Topics("late").radio_rx(1), Reception(b"noise", NodeId(2), 1 * S, -60.0), 1 * S + after_ms * MS)
    assert uav.report()["heard_late"] == late


def test_a_world_that_was_held_up_says_how_many_ticks_nobody_got(make_scenario: Any) -> None:
    keys = {"mobility.model": "formation", "mobility.speed_m_s": 5, "world.engine": "kinematic", "world.tick_ms": 100}
    world = WorldActor(make_scenario(**keys), "late")
    world.start(0)
    world.wake(100 * MS)
    assert world.report()["skipped_ticks"] == 0
    world.wake(5200 * MS)
    assert world.report()["skipped_ticks"] == 49
    assert world.next_wake_ns() == 5200 * MS, "the last of them is still of use"


def test_a_limit_itself_is_not_exceeded(scenario: Scenario) -> None:
    outcome = good(scenario)
    put(outcome, "world", "ticks", value=980)
    put(outcome, "world", "skipped_ticks", value=20)
    assert reasons(outcome) == [], "2 % of a thousand"
    put(outcome, "world", "skipped_ticks", value=21)
    assert len(reasons(outcome)) == 1


def test_what_a_dead_uav_did_not_receive_was_not_lost_on_the_bus(scenario: Scenario) -> None:
    outcome = good(scenario)
    put(outcome, "agent-2", "receptions", value=0)
    assert any("receptions lost on the bus" in reason for reason in reasons(outcome))
    outcome = replace(good(scenario), ended=[("agent-2", -9)])
    put(outcome, "agent-2", "receptions", value=0)
    found = reasons(outcome)
    assert any("agent-2" in reason for reason in found)
    assert not any("receptions lost on the bus" in reason for reason in found)
    put(outcome, "agent-1", "receptions", value=HEARD - round(1.5 * HEARD * validity.LOST_LIMIT))
    assert any("receptions lost on the bus" in reason for reason in reasons(outcome)), "a share of those of the living"


def test_what_a_uav_had_not_read_when_the_run_ended_was_not_lost_on_the_bus(scenario: Scenario) -> None:
    outcome = good(scenario)
    put(outcome, "agent-2", "receptions", value=HEARD - HEARD // 4)
    assert any("receptions lost on the bus" in reason for reason in reasons(outcome))
    put(outcome, "agent-2", "host", "unread_receptions", value=HEARD // 4)
    assert reasons(outcome) == []


def test_what_a_uav_did_not_count_whose_program_was_started_again_was_not_lost_on_the_bus(make_scenario: Any) -> None:
    stop = {"kind": "stop", "node": 2, "at_s": 4, "for_s": 1}
    outcome = good(make_scenario(**{"nodes.count": 2, "faults": [stop]}))
    put(outcome, "agent-2", "receptions", value=HEARD // 2)  # since then
    assert reasons(outcome) == []
    put(outcome, "agent-1", "receptions", value=HEARD // 2)
    assert any("receptions lost on the bus" in reason for reason in reasons(outcome)), "another one's count"


def test_who_is_stopped_for_good_by_a_fault_owes_no_last_report(make_scenario: Any) -> None:
    stop = {"kind": "stop", "node": 2, "at_s": 4}
    for faults, owes in (([stop], False), ([stop, {**stop, "at_s": 2, "for_s": 1}], False), ([], True)):
        outcome = good(make_scenario(**{"nodes.count": 2, "faults": faults}))
        put(outcome, "agent-2", "final", value=False)
        assert any("no last report of agent-2" in reason for reason in reasons(outcome)) == owes, faults
    outcome = good(make_scenario(**{"nodes.count": 2, "faults": [{**stop, "for_s": 1}]}))
    put(outcome, "agent-2", "final", value=False)
    assert any("no last report of agent-2" in reason for reason in reasons(outcome)), "it was started again"


def test_nor_does_who_is_started_again_after_the_end_and_who_was_stopped_at_the_start_owes_none(
    make_scenario: Any,
) -> None:
    stop = {"kind": "stop", "node": 2, "at_s": 4}
    for faults, owes in (([{**stop, "for_s": 6}], False), ([{**stop, "at_s": 10}], True)):  # the run ends at 10 s
        outcome = good(make_scenario(**{"nodes.count": 2, "faults": faults}))
        put(outcome, "agent-2", "final", value=False)
        assert any("no last report of agent-2" in reason for reason in reasons(outcome)) == owes, faults
    for at_s, why, owes in ((0, UNHEARD, False), (10, UNHEARD, True), (0, "malformed: of 9 MB", True)):
        outcome = good(make_scenario(**{"nodes.count": 2, "faults": [{**stop, "at_s": at_s}]}))
        outcome.absent = {"agent-2": why}
        del outcome.reports["agent-2"]
        assert any(f"no report of agent-2 ({why})" in reason for reason in reasons(outcome)) == owes


@pytest.mark.parametrize(
    ("bound", "told"),
    [
        ({"violations": 7}, "did not hold: 7, limit 0"),
        ({"violations": 7, "overtaken": 5}, "did not hold: 2, limit 0 (5 more were overtaken by a fault)"),
        ({"violations": 7, "overtaken": 7}, None),
        ({"violations": 0, "overtaken": 0}, None),
    ],
)
def test_broken_bounds_make_a_run_invalid_but_for_those_that_a_fault_overtook(
    scenario: Scenario, bound: dict[str, int], told: str | None
) -> None:
    frames = {"unaccounted": 0, "unasked": 0, "closes": True, "sent": 1}
    found = validity.reasons(good(scenario), frames=frames, copies={}, bound=bound, clock={}, disturbance={})
    assert found == ([] if told is None else [f"delay bounds that {told}"])
