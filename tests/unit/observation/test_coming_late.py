"""An observer that comes late is told how things stand, before what is put from then on."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from kit import MakeScenario

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import TraceBatch
from fanet_mw.trace import Confirmed, Dropped, FlightModeChanged, MissionModeChanged, RadioFault, Record, Refuted
from fanet_mw.units import NodeId, S
from sim.observation.bus_feed import BusFeed
from sim.records.standing import Standing


def flies(t_s: int, mode: str, node: int = 1) -> FlightModeChanged:
    return FlightModeChanged(t_s * S, NodeId(node), mode)


def test_the_last_mode_each_fault_that_lasts_and_all_finds_stand() -> None:
    standing = Standing()
    begins = RadioFault(3 * S, NodeId(0), NodeId(0), "jam", "jam-1", active=True)
    confirmed = Confirmed(4 * S, NodeId(2), 1, 0.0, 0.0)
    told: list[Record] = [
        flies(1, "takeoff"), flies(2, "velocity"), begins, begins._replace(label="jam-2"), confirmed,
        Dropped(5 * S, NodeId(1), "duplicate", NodeId(2), 7), begins._replace(t_ns=6 * S, active=False),
        Refuted(7 * S, NodeId(3), 1, 0.0, 0.0), MissionModeChanged(8 * S, NodeId(1), "search", 0),
    ]  # fmt: skip
    standing.take(told)
    assert standing.records() == [told[1], told[3], told[4], told[7], told[8]]


def test_a_program_that_finds_without_end_fills_no_memory() -> None:
    standing = Standing()
    standing.take(Confirmed(t_ns, NodeId(2), 1, 0.0, 0.0) for t_ns in range(10_000))
    assert len(standing.records()) < 5000


@pytest.fixture
def feed(make_scenario: MakeScenario, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A feed on a bus that is played here: `put` and `answers`."""
    keeps: list[Callable[[str, bytes], None]] = []
    asked: dict[str, Callable[[str, bytes], None]] = {}
    bus = SimpleNamespace(
        subscribe=lambda _, keep: keeps.append(keep), ask=asked.__setitem__, check=lambda: None, close=lambda: None
    )
    monkeypatch.setattr("sim.observation.bus_feed.Bus.join", lambda *_: bus)
    made = BusFeed("tcp/127.0.0.1:1", "s", scenario=make_scenario(nodes={"count": 3}))
    made.listen(catches_up=True)
    heard: list[Record] = []

    def put(*records: Record) -> None:
        keeps[0](made.names.trace("world"), codecs.encode([TraceBatch(records)]))

    def answer(*records: Record) -> None:
        asked[made.names.standing](made.names.standing, codecs.encode([TraceBatch(records)]))

    listener = SimpleNamespace(take_records=heard.extend)
    return SimpleNamespace(put=put, answer=answer, heard=heard, pump=lambda: made.pump(listener))


def test_what_is_put_meanwhile_waits_for_the_answer_and_comes_once(feed: Any) -> None:
    feed.put(flies(2, "velocity"))
    feed.pump()
    assert feed.heard == []
    feed.answer(flies(2, "velocity"), flies(1, "hover", node=2), flies(1, "hover", node=9), Dropped(S, 1, "x", 2, 7))
    feed.put(flies(3, "land"))
    feed.pump()
    assert feed.heard == [flies(1, "hover", node=2), flies(2, "velocity"), flies(3, "land")]


def test_where_nobody_answers_what_is_put_is_heard_after_a_while(feed: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    feed.put(flies(2, "velocity"))
    feed.pump()
    assert feed.heard == []
    monkeypatch.setattr("sim.observation.bus_feed.time.monotonic", lambda: 1e12)
    feed.pump()
    assert feed.heard == [flies(2, "velocity")]
