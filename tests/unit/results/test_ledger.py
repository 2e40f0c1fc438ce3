"""The ledger of frames, on reports written by hand and on whole runs in which the bus swallows requests."""

from collections.abc import Callable, Mapping
from typing import Any

import pytest

from agents.clock.clocked_uav import make_uav
from emulator.medium import Medium
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, TxRequest
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId
from sim.results import ledger
from sim.results.outcome import Outcome
from sim.run.virtual import simulate
from sim.world.environment.layout import positions
from sim.world.world import WorldActor

Keep = Callable[[int, TxRequest], bool]


def small(make_scenario: Any, **keys: Any) -> Scenario:
    scenario: Scenario = make_scenario(
        **{"nodes.count": 4, "routing.protocol": "flooding", "traffic.sources": "all", "traffic.interval_s": 0.5,
           "duration_s": 3, "warmup_s": 0, "drain_s": 1, **keys}
    )  # fmt: skip
    return scenario


# --- virtual time: the counts must match exactly ----------------------------------------------------------------------


class LossyMedium(Medium):
    """A medium behind a bus that brings only some of the requests."""

    def __init__(self, scenario: Scenario, keep: Keep) -> None:
        super().__init__(scenario, "lossy")
        self._keep = keep
        self._came = 0

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        if isinstance(message, TxRequest):
            self._came += 1
            if not self._keep(self._came, message):
                return
        super().receive(topic, message, now_ns)


def run(scenario: Scenario, keep: Keep) -> Mapping[str, Any]:
    starts = positions(scenario)
    uavs = [make_uav(scenario, NodeId(node), "lossy", position=starts[node - 1]) for node in scenario.node_ids]
    actors: list[Actor] = [WorldActor(scenario, "lossy"), LossyMedium(scenario, keep), *uavs]
    host = VirtualHost(actors)
    host.start()
    host.run(scenario.duration_ns)
    host.stop()
    return ledger.frames(Outcome(scenario, "virtual", 1.0, [], {actor.name: actor.report() for actor in actors}))


def test_in_virtual_time_nothing_is_unaccounted_for(make_scenario: Any) -> None:
    scenario = small(make_scenario)
    frames = run(scenario, lambda _, __: True)
    assert frames == ledger.frames(simulate(scenario))
    assert frames["sent"] > 50
    assert frames["closes"]
    assert (frames["unaccounted"], frames["unasked"]) == (0, 0)


LOSSES: Mapping[str, Keep] = {
    "every second one": lambda count, _: count % 2 == 0,
    "all": lambda _, __: False,
    "the first of each node": lambda _, request: request.seq > 0,
    "the last ones": lambda count, _: count < 40,
    "a single one": lambda count, _: count != 30,
}


@pytest.mark.parametrize("keep", LOSSES.values(), ids=LOSSES.keys())
def test_a_host_that_swallows_requests_does_not_close(make_scenario: Any, keep: Keep) -> None:
    frames = run(small(make_scenario), keep)
    assert not frames["closes"]
    assert frames["unaccounted"] > 0
    explained = frames["delivered"] + sum(frames["dropped"].values()) + frames["in_flight"]
    assert frames["sent"] == explained + frames["unaccounted"]


# --- real time: a gap is a loss with a name ---------------------------------------------------------------------------


def agent(node: int, sent: int, *, final: bool = True) -> dict[str, Any]:
    return {"kind": "agent", "node": node, "frames_sent": sent, "receptions": 0, "final": final}


def emulator(had: Mapping[int, int], *, bus: int = 0, before: Mapping[int, int] | None = None) -> dict[str, Any]:
    """The report of a medium that had these requests, gaps included, and delivered all that came."""
    total = sum(had.values())
    return {
        "kind": "emulator",
        "final": True,
        "frames": {"sent": total, "delivered": total - bus, "in_flight": 0, "dropped": {"bus": bus} if bus else {}},
        "requests": {
            str(node): {"all": count, "before_restart": (before or {}).get(node, 0)} for node, count in had.items()
        },
    }


def frames_of(scenario: Scenario, *reports: Mapping[str, Any], ended: tuple[str, ...] = ()) -> dict[str, Any]:
    names = {"emulator" if report["kind"] == "emulator" else f"agent-{report['node']}": report for report in reports}
    outcome = Outcome(scenario, "realtime", 1.0, [], names, ended=[(name, -9) for name in ended])
    return ledger.frames(outcome)


@pytest.fixture
def two(make_scenario: Any) -> Scenario:
    return small(make_scenario, **{"nodes.count": 2})


def test_what_the_medium_never_had_was_lost_on_the_bus(two: Scenario) -> None:
    """Three that no later request showed to be missing, besides the two that a gap did."""
    frames = frames_of(two, agent(1, 10), agent(2, 20), emulator({1: 7, 2: 20}, bus=2))
    assert frames["dropped"] == {"bus": 5}
    assert frames["in_flight"] == 0
    assert (frames["sent"], frames["delivered"], frames["closes"]) == (30, 25, True)


def test_one_nodes_surplus_does_not_hide_what_another_lost(two: Scenario) -> None:
    frames = frames_of(two, agent(1, 10), agent(2, 20), emulator({1: 13, 2: 17}))
    assert frames["dropped"] == {"bus": 3}
    assert frames["unasked"] == 3
    assert not frames["closes"]


def test_frames_that_a_dead_emulator_took_with_it_are_unaccounted_for(two: Scenario) -> None:
    frames = frames_of(two, agent(1, 400), agent(2, 400), emulator({1: 300, 2: 315}), ended=("emulator",))
    assert (frames["sent"], frames["unaccounted"], frames["dropped"]) == (800, 185, {})
    assert not frames["closes"]


def test_without_a_report_of_the_emulator_all_frames_are_unaccounted_for(two: Scenario) -> None:
    frames = frames_of(two, agent(1, 4), agent(2, 4))
    assert (frames["sent"], frames["unaccounted"], frames["closes"]) == (8, 8, False)


def test_of_a_node_that_started_again_both_lives_are_counted(two: Scenario) -> None:
    medium = emulator({1: 47, 2: 10}, before={1: 40})
    frames = frames_of(two, agent(1, 9), agent(2, 10), medium, ended=("agent-1",))
    assert (frames["sent"], frames["dropped"], frames["closes"]) == (59, {"bus": 2}, True)


def test_the_mediums_count_stands_for_a_node_that_died_or_was_cut_off_before_its_last_report(two: Scenario) -> None:
    medium = emulator({1: 47, 2: 12})
    frames = frames_of(two, agent(1, 40), agent(2, 10, final=False), medium, ended=("agent-1",))
    assert (frames["sent"], frames["unasked"], frames["closes"]) == (59, 0, True)
