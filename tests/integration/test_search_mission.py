"""A whole planned search in small: 12 UAVs, 500 x 500 m, three survivors; what it is led by, and what it survives."""

from array import array
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any, Final

import pytest

from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, Obstructions, Poses
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Confirmed, Planned, Posed, Record, Sighted
from fanet_mw.units import S
from sim.results.mission import mission
from sim.results.outcome import Outcome
from sim.run.virtual import actors_of, simulate
from sim.scenarios.catalog import find

KEYS: Final = (
    "nodes.count=12", "nodes.spacing_m=100", "nodes.telemetry_hz=0", "world.area_m=500", "mission.survivors=3",
    "traffic.arrivals=none", "clusters.count=2", "clusters.flooding_period_s=1", "seed=1",
)  # fmt: skip

FEW: Final = ("nodes.count=3", "clusters.count=1", "traffic.sources=2", "world.area_m=300", "mission.search=spiral")
"""The same with three UAVs over less ground."""


class Around(Actor):
    """One UAV, and something between it and the bus; its output is its own."""

    def __init__(self, inner: Actor, *topics: str) -> None:
        self._inner = inner
        super().__init__(inner.name, (*inner.subscriptions, *topics))

    @property
    def outbox(self) -> list[tuple[str, Message]]:  # type: ignore[override]
        return self._inner.outbox

    @outbox.setter
    def outbox(self, value: list[tuple[str, Message]]) -> None:
        self._inner.outbox = value

    @property
    def records(self) -> list[Record]:  # type: ignore[override]
        return self._inner.records

    @records.setter
    def records(self, value: list[Record]) -> None:
        self._inner.records = value

    def start(self, now_ns: int) -> None:
        self._inner.start(now_ns)

    def receive(self, topic: str, message: Message, now_ns: int) -> bool | None:
        return self._inner.receive(topic, message, now_ns)

    def wake(self, now_ns: int) -> None:
        self._inner.wake(now_ns)

    def next_wake_ns(self) -> int | None:
        return self._inner.next_wake_ns()

    def stop(self, now_ns: int) -> None:
        self._inner.stop(now_ns)

    def report(self) -> dict[str, object]:
        return dict(self._inner.report())


def flown(wrap: Callable[[Actor, Topics], Actor], *, seconds: int, keys: Sequence[str] = ()) -> Outcome:
    """The mission in which each UAV is wrapped."""
    return run_with(find("rescue", [*KEYS, *keys, f"duration_s={seconds}"]), wrap)


def run_with(scenario: Scenario, wrap: Callable[[Actor, Topics], Actor]) -> Outcome:
    """The scenario in which each UAV is wrapped."""
    world, medium, *uavs = actors_of(scenario, scenario.name)
    records: list[Record] = []
    names = Topics(scenario.name)
    actors = [world, medium, *(wrap(uav, names) for uav in uavs)]
    host = VirtualHost(actors, on_records=records.extend)
    host.start()
    host.run(scenario.duration_ns)
    host.stop()
    reports = {actor.name: actor.report() for actor in actors}
    return Outcome(scenario=scenario, mode="virtual", wall_s=1.0, records=records, reports=reports)


def mission_of(outcome: Outcome) -> dict[str, Any]:
    return mission(outcome.scenario, outcome.records)


class Told(Around):
    """A UAV that is told what only the world knows: as it is, or turned around and far away."""

    def __init__(self, inner: Actor, names: Topics, *, poisoned: bool) -> None:
        super().__init__(inner, names.pose, names.obstruction)
        self._poisoned = poisoned

    def receive(self, topic: str, message: Message, now_ns: int) -> bool | None:
        if self._poisoned and isinstance(message, Poses):
            message = message._replace(states=array("d", [1e5 - 3 * value for value in message.states]))
        elif self._poisoned and isinstance(message, Obstructions):
            message = message._replace(pairs=array("H", [1, 2]))
        return self._inner.receive(topic, message, now_ns)


@pytest.mark.parametrize(("keys", "seconds"), [(FEW, 30), pytest.param((), 40, marks=pytest.mark.slow)])
def test_a_whole_mission_goes_as_it_does_when_the_worlds_truth_is_poisoned_for_every_uav(
    keys: Sequence[str], seconds: int
) -> None:
    clean, poisoned = (
        flown(lambda uav, names, lie=lie: Told(uav, names, poisoned=lie), seconds=seconds, keys=keys)  # type: ignore[misc]
        for lie in (False, True)
    )
    assert sum(isinstance(record, Confirmed) for record in poisoned.records) >= 1
    assert list(poisoned.records) == list(clean.records)
    refused = [report["bus_malformed"] for name, report in poisoned.reports.items() if name.startswith("agent-")]
    assert min(refused) > 100, "every UAV was told, and took in nothing"  # type: ignore[type-var]


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("town", ["duration_s=40"]),  # buildings, a no-fly area, a map and radar
        ("night", ["duration_s=40", "sensors.gps_outages=[[0,0,600,10,35]]"]),
        ("convoy", ["duration_s=60"]),  # formation flight
    ],
)
def test_a_shipped_flight_goes_as_it_does_when_the_worlds_truth_is_poisoned(name: str, keys: Sequence[str]) -> None:
    clean, poisoned = (
        run_with(find(name, keys), lambda uav, names, lie=lie: Told(uav, names, poisoned=lie))  # type: ignore[misc]
        for lie in (False, True)
    )
    assert list(poisoned.records) == list(clean.records)
    refused = [report["bus_malformed"] for name, report in poisoned.reports.items() if name.startswith("agent-")]
    assert min(refused) > 100, "every UAV was told, and took in nothing"  # type: ignore[type-var]


@pytest.mark.slow
def test_three_uavs_search_all_by_a_spiral_and_confirm_everybody() -> None:
    found = mission_of(simulate(find("rescue", [*KEYS, *FEW, "duration_s=160"])))
    assert found["coverage"] == found["connected"] == 1.0
    assert found["confirmed"] == found["survivors"]
    assert not found["mistaken"] + found["collisions"]


@pytest.mark.slow
def test_a_survivor_in_the_open_is_confirmed_by_voice_alone_from_a_uav_that_goes_down_to_listen() -> None:
    by_ear = ["sensors.camera_hz=0", "sensors.voice_hz=2", "duration_s=78"]
    outcome = simulate(find("rescue", [*KEYS, *FEW, *by_ear]))
    found = mission_of(outcome)
    assert found["confirmed"] >= 1
    assert not found["mistaken"] + found["collisions"]
    confirmed = next(record for record in outcome.records if isinstance(record, Confirmed))
    assert {record.sensor for record in outcome.records if isinstance(record, Sighted)} == {"voice"}
    poses = [record for record in outcome.records if isinstance(record, Posed) and record.node == confirmed.node]
    assert min(pose.up_m for pose in poses if pose.t_ns <= confirmed.t_ns) < 25, "this one shouts louder than 88 dB"
    assert max(pose.up_m for pose in poses if pose.t_ns > confirmed.t_ns) > 22, "up, until it is near the next survivor"


def test_who_waits_keeps_its_height_though_it_knows_it_inexactly() -> None:
    """It was sent to where its last fix said that it was, and sank by 3 m a minute."""
    alone = ("nodes.count=3", "nodes.spacing_m=1000", "traffic.sources=0", "mission.survivors=0", "duration_s=20")
    outcome = simulate(find("rescue", [*alone, "warmup_s=1", "drain_s=1", "mission.search=spiral"]))
    last = {record.node: record.up_m for record in outcome.records if isinstance(record, Posed)}
    assert list(last.values()) == pytest.approx([65.0] * 3, abs=0.4)


@pytest.mark.slow
def test_without_a_network_every_uav_searches_a_lane_of_its_own_and_no_two_touch() -> None:
    cuts = [f"{{kind='degrade', at_s=0, src={a}, dst={b}, loss_share=1}}" for a, b in combinations(range(1, 8), 2)]
    outcome = flown(
        lambda uav, _: uav, seconds=42, keys=["nodes.count=7", "world.area_m=350", f"faults=[{', '.join(cuts)}]"]
    )
    places = {record.node: record.place for record in outcome.records if isinstance(record, Planned)}
    assert sorted(places.values()) == list(range(7))
    found = mission_of(outcome)
    assert not found["collisions"]
    assert found["coverage"] >= 0.93, "a lane that nobody searched would be a seventh"


class Lost(Around):
    """A UAV whose computer stops in mid-flight: it hears, says and commands nothing any more."""

    def __init__(self, inner: Actor, names: Topics, *, at_ns: int) -> None:
        super().__init__(inner)
        self._at_ns = at_ns

    def receive(self, topic: str, message: Message, now_ns: int) -> bool | None:
        return self._inner.receive(topic, message, now_ns) if now_ns < self._at_ns else True

    def wake(self, now_ns: int) -> None:
        if now_ns < self._at_ns:
            self._inner.wake(now_ns)

    def next_wake_ns(self) -> int | None:
        wanted_ns = self._inner.next_wake_ns()
        return wanted_ns if wanted_ns is not None and wanted_ns < self._at_ns else None


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_what_a_lost_uav_would_have_searched_is_searched_by_those_beside_it() -> None:
    """The holder of a corner lane is lost when the sweep begins; nobody takes its place, and its row closes ranks."""
    before = flown(lambda uav, _: uav, seconds=20)
    plans = [record for record in before.records if isinstance(record, Planned)]
    corner = next(record.node for record in plans if record.place == 0 and record.node != 1)
    after = flown(
        lambda uav, names: Lost(uav, names, at_ns=16 * S) if uav.name == f"agent-{corner}" else uav, seconds=150
    )
    assert {r.node for r in after.records if isinstance(r, Planned) and r.place == 0} == {corner}
    found = mission_of(after)
    assert found["coverage"] >= 0.99
    assert found["confirmed"] == 3


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_lanes_of_two_that_are_lost_at_the_ends_of_a_line_are_searched_in_the_first_sweep() -> None:
    """The outermost two of a line are lost before the sweep; without closing ranks 92 % would be covered."""
    wide = ("nodes.count=20", "traffic.sources=19", "world.area_m=1000")
    plans = [r for r in flown(lambda uav, _: uav, seconds=20, keys=wide).records if isinstance(r, Planned)]
    names = {f"agent-{plan.node}" for plan in plans if plan.place in (0, 5)}
    assert len(names) == 2
    after = flown(
        lambda uav, topics: Lost(uav, topics, at_ns=32 * S) if uav.name in names else uav, seconds=98, keys=wide
    )
    assert mission_of(after)["coverage"] >= 0.955


@pytest.mark.slow
def test_200_uavs_have_the_plan_long_before_it_begins() -> None:
    keys = ("nodes.count=200", "world.area_m=5000", "traffic.sources=[]", "radio.lead_ms=0", "radio.handover_ms=0")
    outcome = simulate(find("rescue", [*keys, "duration_s=18", "seed=1"]))
    planned_s = sorted(record.t_ns / S for record in outcome.records if type(record) is Planned)
    assert len(planned_s) >= 200
    assert planned_s[199] - planned_s[0] < 5.0
