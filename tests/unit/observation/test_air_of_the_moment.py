"""The picture of the air in the view: from announced frames, or from a run's capture."""

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from kit import MakeScenario

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.units import BROADCAST, MS, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, PRIORITY_BULK, PRIORITY_SAFETY, Header, Kind, filler
from sim.cli.app import app
from sim.observation.air_causes import AirCauses, Cause
from sim.observation.swarm_state import SwarmState
from sim.view.air import CapturedAir, LiveAir, air_text, drawn_ns


def put(
    sender: int, origin: int, seq: int, at_ns: int, *, kind: Kind = Kind.DATA, priority: int = PRIORITY_BULK
) -> tuple[str, bytes]:
    header = Header(0, seq, origin, BROADCAST, sender, kind, 8, 0, priority, FLAG_FLOOD)
    request = TxRequest(0, at_ns, header.encode() + filler(40), NodeId(BROADCAST), wants_status=False)
    return Topics("s").radio_tx(sender), codecs.encode([request])


@pytest.fixture
def heard(make_scenario: MakeScenario) -> Any:
    """A feed of the bus; `say` puts something on it."""
    listeners: list[Any] = []
    bus = SimpleNamespace(subscribe=lambda expression, keep: listeners.append((expression, keep)))

    def say(topic: str, payload: bytes) -> None:
        for _, keep in listeners:
            keep(topic, payload)

    return SimpleNamespace(
        bus=bus, names=Topics("s"), scenario=make_scenario(nodes={"count": 3}), say=say, listeners=listeners
    )


def test_nothing_is_listened_to_before_somebody_looks_nor_kept_after(heard: Any) -> None:
    air = LiveAir(heard)
    assert not heard.listeners
    assert air.nothing in air_text(air, [1, 2, 3], 5 * S, length_ns=S)
    heard.say(*put(1, 1, 7, 5 * S))
    assert air.between(4 * S, 6 * S)
    air.rest()
    heard.say(*put(2, 1, 7, 5 * S))
    assert air.between(4 * S, 6 * S) == []
    assert len(heard.listeners) == 1


def test_each_frame_is_drawn_in_the_row_of_its_sender_and_counted_by_its_cause(heard: Any) -> None:
    air = LiveAir(heard)
    air.between(0, 1)
    for one in (put(1, 1, 7, 9 * S), put(2, 1, 7, 9 * S + MS), put(2, 1, 7, 9 * S + 2 * MS)):
        heard.say(*one)
    heard.say(*put(3, 3, 0, 6 * S, kind=Kind.HELLO))  # counted, and no longer drawn
    heard.say(Topics("s").radio_tx(1), b"scrambled")
    text = air_text(air, [1, 2, 3], 10 * S, length_ns=S, selected=2)
    rows = re.findall(r"</span> ([\w ]+)</td><td>", text)
    assert rows == ["own packets", "relayed", "sent again", "hellos"]
    drawn = [re.findall(r"M[\d.]+ ([\d.]+)h", path) for path in re.findall(r"<path stroke='#\w{6}'.*?/>", text)]
    assert [len(marks) for marks in drawn] == [1, 1, 1]
    assert drawn[0] != drawn[1] == drawn[2]
    assert "<rect" in text


def test_priorities_have_their_shares_and_losses_their_reasons(heard: Any) -> None:
    air = LiveAir(heard)
    air.between(0, 1)
    for one in (
        put(1, 1, 7, 9 * S),
        put(1, 1, 8, 9 * S + MS, priority=PRIORITY_SAFETY),
        put(3, 3, 0, 9 * S + 2 * MS, kind=Kind.HELLO),
    ):
        heard.say(*one)
    state = SwarmState(heard.scenario)
    for t_ns, on_air, lost in (
        (1 * S, 1000, {"collision": 500}),
        (9 * S, 2000, {"collision": 600}),
        (10 * S, 2100, {"collision": 625, "half_duplex": 5}),
    ):
        state.take_report("emulator", {"copies": {"on_air": on_air, "lost": lost}}, t_ns=t_ns)
    assert state.losses() == {"collision": 0.25, "half_duplex": 0.05}
    text = air_text(air, [1, 2, 3], 10 * S, length_ns=S, losses=state.losses())
    rows = re.findall(r"<td>(?:packets|copies lost): ([\w ]+)</td><td>(\d*)</td>", text)
    assert rows == [("safety", "0"), ("bulk", "0"), ("collision", ""), ("half duplex", "")]
    assert "25.00 %" in text


def test_without_reports_of_the_emulator_no_losses_are_known(heard: Any) -> None:
    state = SwarmState(heard.scenario)
    state.take_report("emulator", {"copies": {"on_air": 100, "lost": {"collision": 5}}}, t_ns=1 * S)
    assert state.losses() == {}
    for t_ns, on_air in ((2 * S, 10), (3 * S, 20)):
        state.take_report("emulator", {"copies": {"on_air": on_air, "lost": {"collision": on_air}}}, t_ns=t_ns)
    assert state.losses() == {"collision": 1.0}, "a new emulator counts from the start"


def test_packets_of_long_ago_are_forgotten_at_last(make_scenario: MakeScenario) -> None:
    causes, payload = AirCauses(make_scenario(), remembers=10), {}
    for seq in range(25):
        header = Header(0, seq, 1, BROADCAST, 1, Kind.DATA, 8, 0, PRIORITY_BULK, FLAG_FLOOD)
        payload[seq] = header.encode() + filler(40)
        assert causes.frame(seq, 1, payload[seq], frame_bytes=80).cause is Cause.OWN
    assert causes.frame(30, 1, payload[24], frame_bytes=80).cause is Cause.AGAIN
    assert causes.frame(31, 1, payload[15], frame_bytes=80).cause is Cause.AGAIN
    assert causes.frame(32, 1, payload[0], frame_bytes=80).cause is Cause.OWN


def test_a_capture_shows_the_air_of_any_instant_and_its_absence_is_said(tmp_path: Path) -> None:
    words = ["simulate", "quick", "--set", "duration_s=12", "--out", str(tmp_path / "run"), "--pcap", "--json"]
    assert app(words, result_action="return_value") == 0
    from sim.observation.timeline import Timeline

    timeline = Timeline(tmp_path / "run")
    air = CapturedAir(tmp_path / "run", timeline.scenario, epoch_unix_ns=timeline.epoch_unix_ns)
    sent = air.between(5 * S, 6 * S)
    assert {one.node for one in sent} <= {*timeline.scenario.node_ids, 0}
    assert all(5 * S <= one.start_ns < 6 * S for one in sent)
    assert {Cause.OWN, Cause.RELAYED} <= {one.cause for one in sent}
    assert "frames/s" in air_text(air, timeline.scenario.node_ids, 6 * S, length_ns=S)
    nowhere = CapturedAir(tmp_path, timeline.scenario, epoch_unix_ns=0)
    assert "--pcap" in air_text(nowhere, [1], 4 * S, length_ns=S)


@pytest.mark.parametrize(("period_ms", "drawn_ms"), [(28, 168), (146, 292), (800, 800), (5000, 1000), (0, 500)])
def test_some_whole_rounds_are_drawn(period_ms: int, drawn_ms: int) -> None:
    assert drawn_ns(period_ms * MS) == drawn_ms * MS
