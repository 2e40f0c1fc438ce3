"""Faults on the air: a degraded link, a jammed area, a node cut off; by message and by scenario, each loss counted."""

import math
import random
from array import array
from collections.abc import Callable

import pytest
from kit import slow
from test_medium_timelines import ACK_NS, FRAME_NS, NAMES, PAYLOAD, SIFS_NS, Air, receptions, statuses

from emulator import faults
from emulator.kernel.state import LINK_DST, LINK_SRC, SPARED
from fanet_mw.bus.messages import Poses, Reception, TxOutcome, TxRequest
from fanet_mw.bus.radio_control import Control, Cut, Degrade, Jam, Mishap, MishapKind, Partition, Restore
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario, config
from fanet_mw.trace import RadioFault, line, parse
from fanet_mw.units import BROADCAST, MS, STILL, US, Enu, NodeId, S

MakeScenario = Callable[..., Scenario]


def cut(node: int, *, label: str = "c", for_ns: int = 0) -> Cut:
    return Cut(label, NodeId(node), for_ns)


def degrade(src: int, dst: int, *, db: float = 0.0, share: float = 0.0, both: bool = False) -> Degrade:
    return Degrade("d", NodeId(src), NodeId(dst), both, db, share)


def jam(east_m: float, radius_m: float, *, noise_dbm: float = math.inf, for_ns: int = 0) -> Jam:
    return Jam("j", Enu(east_m, 0.0, 0.0), radius_m, noise_dbm, for_ns)


def control(air: Air, *controls: Control, now_ns: int = 0) -> None:
    for message in controls:
        air.medium.receive(NAMES.radio_control, message, now_ns)


def dropped(air: Air) -> dict[str, int]:
    return dict(air.medium.report()["frames"]["dropped"])


def lost(air: Air) -> dict[str, int]:
    return dict(air.medium.report()["copies"]["lost"])


# --- a node cut off -----------------------------------------------------------------------------------------------


def test_a_node_cut_off_neither_hears_nor_is_heard_nor_sensed(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 100, 200])
    control(air, cut(2))
    air.send(2, 1 * MS)
    air.send(1, 1 * MS + 300 * US)
    heard = receptions(air.run())
    assert heard == [(3, 1, 1 * MS + 300 * US + FRAME_NS + 667)], "at once: nobody senses node 2"
    assert dropped(air) == {"station_down": 1}
    assert lost(air) == {"station_down": 3}
    copies = air.medium.report()["copies"]
    assert copies["on_air"] == 4 == copies["received"] + 3


def test_the_trace_says_where_the_air_is_parted_and_jammed(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 100, 200])
    two = Partition("p", (NodeId(3), NodeId(1)), (0.0, 0.0, 0.0, 0.0))
    control(air, two, two._replace(group=(), line_m=(1.5, 0.0, 0.0, -9.0)), jam(5.0, 20.0), cut(2))
    records = [record for record in air.medium.records if isinstance(record, RadioFault)]
    assert [record.extent for record in records if record.active] == [
        "nodes 3 1", "line 1.5 0.0 0.0 -9.0", "circle 5.0 0.0 20.0 inf", "",
    ]  # fmt: skip
    assert [parse(line(record)) for record in records] == records


def test_unicast_to_a_node_cut_off_is_given_up_and_counted_as_that(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    control(air, cut(2))
    air.send(1, 1 * MS, dst=2)
    ((_, outcome, _, attempts),) = statuses(air.run())
    assert (outcome, attempts) == (TxOutcome.RETRY_LIMIT, 7)
    assert dropped(air) == {"station_down": 1}


def test_a_cut_ends_by_itself_at_its_instant(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    control(air, cut(2, for_ns=10 * MS))
    for at_us in (1000, 8000, 10_000, 12_000):  # what happens at the instant itself is still of the time before
        air.send(1, at_us * US)
    assert [end for *_, end in receptions(air.run())] == [12 * MS + FRAME_NS + 334]
    assert dropped(air) == {"station_down": 3}
    assert air.medium.records == [
        RadioFault(0, 2, 0, "cut", "c", active=True), RadioFault(10 * MS, 2, 0, "cut", "c", active=False),
    ]  # fmt: skip


def test_a_frame_under_way_to_a_node_that_is_cut_off_is_lost_as_that(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    air.send(1, 1 * MS)
    control(air, cut(2), now_ns=1 * MS + 500 * US)
    assert receptions(air.run()) == []
    assert dropped(air) == {"station_down": 1}


# --- a degraded link ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("both", "got"), [(False, [(1, 2)]), (True, [])])
def test_a_link_is_degraded_in_one_direction_or_in_both(
    make_scenario: MakeScenario, *, both: bool, got: list[tuple[int, int]]
) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    control(air, degrade(1, 2, share=1.0, both=both))
    air.send(1, 1 * MS)
    air.send(2, 10 * MS)
    assert [(receiver, src) for receiver, src, _ in receptions(air.run())] == got
    assert dropped(air) == {"degraded": 1 + both}


def test_a_share_of_frames_is_lost_and_acks_too(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    control(air, degrade(1, 2, share=0.3))
    for i in range(1000):
        air.send(1, (1 + 2 * i) * MS, now_ns=0, payload=b"x" * 100)
    got = len(receptions(air.run(3 * S)))
    assert 700 - 4 * math.sqrt(210) < got < 700 + 4 * math.sqrt(210)
    assert lost(air) == {"degraded": 1000 - got}
    back = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    control(back, degrade(2, 1, share=1.0))
    back.send(1, 1 * MS, dst=2)
    heard = back.run()
    assert [outcome for _, outcome, *_ in statuses(heard)] == [TxOutcome.RETRY_LIMIT], "no ACK comes back"
    assert len(receptions(heard)) == 1
    assert dropped(back) == {}, "it was delivered all the same"


def test_loss_in_decibels_lowers_the_rssi_and_at_last_the_link_is_gone(make_scenario: MakeScenario) -> None:
    def rssi(*faults: Control) -> tuple[list[float], dict[str, int]]:
        air = Air(make_scenario(**{"nodes.count": 2, "radio.channel": "log_distance"}), [0, 100])
        control(air, *faults)
        air.send(1, 1 * MS)
        heard = [h.message.rssi_dbm for h in air.run() if isinstance(h.message, Reception)]
        return heard, lost(air)

    ((before,), _) = rssi()
    ((after,), _) = rssi(degrade(1, 2, db=7.5))
    assert before - after == pytest.approx(7.5, abs=0.002)
    assert rssi(degrade(1, 2, db=50)) == ([], {"degraded": 1})


@pytest.mark.parametrize(("db", "got"), [(111.0, 1), (113.0, 0)])
def test_where_all_frames_are_equally_strong_a_link_is_gone_below_the_sensitivity(
    make_scenario: MakeScenario, db: float, got: int
) -> None:
    """30 dBm, sensitivity -82 dBm. A link that is gone does not disturb either: 3 is heard through 1's frame."""
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 200, 400])
    control(air, degrade(1, 2, db=db))
    air.send(1, 1 * MS)
    air.send(3, 1 * MS + (300 * US if got == 0 else 20 * MS))
    sources = [src for receiver, src, _ in receptions(air.run()) if receiver == 2]
    assert sources == ([1, 3] if got else [3])
    assert lost(air) == ({} if got else {"degraded": 1})


def test_a_link_that_is_gone_does_not_disturb_though_farther_receivers_hear(make_scenario: MakeScenario) -> None:
    """1 and 4 do not sense each other. At 2 only 4's frame is on the air, at 3 both are."""
    air = Air(make_scenario(**{"nodes.count": 4}), [0, 100, 200, 300])
    control(air, degrade(1, 2, db=200))
    air.send(1, 1 * MS)
    air.send(4, 1 * MS + 300 * US)
    assert [(receiver, src) for receiver, src, _ in receptions(air.run())] == [(2, 4)]
    assert lost(air) == {"collision": 2, "degraded": 1}


def test_a_degraded_link_that_breaks_in_mid_frame_loses_no_more_than_its_share(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 200])
    control(air, degrade(1, 2, share=0.001))
    air.send(1, 1 * MS)
    air.place([0, 900], 1 * MS + 500 * US)
    assert receptions(air.run()) == [(2, 1, 1 * MS + FRAME_NS + 667)]


# --- a jammed area ------------------------------------------------------------------------------------------------


def test_receivers_inside_a_jammed_area_hear_nothing_and_those_outside_all(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 100, 200])
    control(air, jam(200, 50))
    air.send(1, 1 * MS)
    air.send(3, 5 * MS)
    assert [(receiver, src) for receiver, src, _ in receptions(air.run())] == [(2, 1), (2, 3), (1, 3)]
    assert lost(air) == {"jammed": 1}


def test_who_flies_into_a_jammed_area_is_jammed_and_who_leaves_it_is_not(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    control(air, jam(200, 50))
    air.send(1, 1 * MS)
    air.place([0, 190], 5 * MS)
    air.send(1, 6 * MS, now_ns=5 * MS)
    air.place([0, 150], 10 * MS)
    air.send(1, 11 * MS, now_ns=10 * MS)
    air.place([0, 149], 15 * MS)
    air.send(1, 16 * MS, now_ns=15 * MS)
    air.run()
    assert air.medium.report()["copies"] == {"on_air": 4, "received": 2, "lost": {"jammed": 2}, "in_flight": 0}


@pytest.mark.parametrize(("noise_dbm", "got"), [(-110.0, 1), (-60.0, 0)])
def test_noise_jams_by_its_strength(make_scenario: MakeScenario, noise_dbm: float, got: int) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "radio.channel": "log_distance"}), [0, 150])
    control(air, jam(150, 10, noise_dbm=noise_dbm))
    air.send(1, 1 * MS)
    assert len(receptions(air.run())) == got
    assert lost(air) == ({} if got else {"jammed": 1})


# --- their life ---------------------------------------------------------------------------------------------------


def test_restore_ends_one_or_all_and_a_new_fault_takes_the_place_of_the_old(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 100, 200])
    control(air, cut(2, label="a", for_ns=20 * MS), cut(3, label="b"))
    control(air, cut(1, label="a"), now_ns=5 * MS)
    air.send(2, 30 * MS, now_ns=5 * MS)
    control(air, Restore("b"), now_ns=40 * MS)
    air.send(2, 41 * MS, now_ns=40 * MS)
    control(air, Restore(""), now_ns=50 * MS)
    air.send(2, 51 * MS, now_ns=50 * MS)
    assert [(receiver, end // MS) for receiver, _, end in receptions(air.run())] == [(3, 41), (1, 51), (3, 51)]
    assert [(r.t_ns // MS, r.label, r.active) for r in air.medium.records] == [
        (0, "a", True), (0, "b", True), (5, "a", False), (5, "a", True), (40, "b", False), (50, "a", False),
    ]  # fmt: skip


def test_controls_that_cannot_be_meant_are_counted_and_change_nothing(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    nan = math.nan
    control(
        air, cut(3), cut(0), degrade(1, 9, share=1), degrade(1, 2, db=nan), degrade(1, 2, share=1.5),
        degrade(2, 2, share=1), jam(nan, 5), jam(0, -1), jam(0, 5, noise_dbm=nan), jam(0, 5, noise_dbm=1e9),
        cut(1, label=""), cut(1, label="x" * 33), cut(1, label="\x00"), cut(1, for_ns=-1), cut(1, for_ns=2**62),
        Restore("nothing"),
    )  # fmt: skip
    air.medium.receive(NAMES.pose, cut(1), 0)
    air.send(1, 1 * MS)
    assert len(receptions(air.run())) == 1
    assert air.medium.records == []
    assert air.medium.report()["refused"] == {
        "fault_label": 3, "fault_unknown_label": 1, "fault_unknown_node": 3, "fault_value": 9, "message_type": 1,
    }  # fmt: skip


def test_no_more_than_so_many_faults_stand_at_a_time(
    make_scenario: MakeScenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert faults.MAX_FAULTS == 1024
    monkeypatch.setattr(faults, "MAX_FAULTS", 20)  # each change computes all links anew
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    control(air, *(cut(1, label=f"{i}") for i in range(26)), cut(2, label="3"))
    assert air.medium.report()["refused"] == {"fault_limit": 6}


# --- in a scenario ------------------------------------------------------------------------------------------------


def test_a_scenarios_faults_come_at_their_instants(make_scenario: MakeScenario) -> None:
    faults = [
        {"at_s": 0.02, "kind": "restore", "label": "node-2"},
        {"at_s": 0.01, "kind": "cut", "node": 2, "for_s": 5.0},
        {"at_s": 0.03, "kind": "jam", "center_m": [100.0, 0.0], "radius_m": 10.0, "for_s": 0.01},
        {"at_s": 0.05, "kind": "degrade", "src": 1, "dst": 2, "loss_share": 1.0},
    ]
    air = Air(make_scenario(**{"nodes.count": 2, "faults": faults}), [0, 100])
    for at_ms in (5, 11, 18, 21, 31, 38, 41, 51):
        air.send(1, at_ms * MS)
    assert [(end - FRAME_NS) // MS for *_, end in receptions(air.run())] == [5, 21, 41]
    assert lost(air) == {"station_down": 2, "jammed": 2, "degraded": 1}
    assert [(r.t_ns // MS, r.kind, r.active) for r in air.medium.records] == [
        (10, "cut", True), (20, "cut", False), (30, "jam", True), (40, "jam", False), (50, "degrade", True),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ({"at_s": 1, "kind": "cut", "node": 99}, "faults.0 names node 99, which must be <= nodes.count"),
        ({"at_s": 1, "kind": "degrade", "src": 2, "dst": 2}, "src = dst = 2 is no link"),
        ({"at_s": 1, "kind": "degrade", "src": 2}, "src and dst must both be given"),
        ({"at_s": 1, "kind": "degrade", "src": 1, "dst": 2, "loss_share": 2}, "faults.0.loss_share = 2"),
        ({"at_s": 1, "kind": "mute", "node": 99}, "faults.0 names node 99, which must be <= nodes.count"),
        ({"at_s": 1, "kind": "crash", "node": 10}, "faults.0 names node 10, which must be <= nodes.count"),
        ({"at_s": 1, "kind": "battery", "node": 1, "charge": 0.2}, "needs sensors.battery_hz > 0"),
        ({"at_s": 1, "kind": "battery", "node": 1, "charge": 2}, "faults.0.charge = 2"),
        ({"at_s": 1, "kind": "partition"}, "either nodes or line_m must be given"),
        ({"at_s": 1, "kind": "partition", "nodes": [1], "line_m": [[0, 0], [1, 1]]}, "either nodes or line_m"),
        ({"at_s": 1, "kind": "partition", "line_m": [[1, 1], [1, 1]]}, "must be two different points"),
        ({"at_s": 1, "kind": "partition", "nodes": [1, 12]}, "faults.0 names node 12"),
        ({"at_s": 1, "kind": "partition", "nodes": list(range(1, 10))}, "leaves nobody on the other side"),
        (
            {"at_s": 1, "kind": "storm"},
            "'mute', 'deaf', 'partition', 'crash', 'battery', 'gps', 'stop', 'restore'",
        ),
    ],
)
def test_a_fault_that_cannot_be_is_one_sentence(fault: dict[str, object], said: str) -> None:
    with pytest.raises(ConfigError, match=said.replace(".", r"\.")):
        config.build({"nodes": {"count": 9}, "faults": [fault]})


# --- in one direction, and in parts -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "heard_by"),
    [("mute", {(1, 2), (1, 3), (3, 1), (3, 2)}), ("deaf", {(1, 3), (2, 1), (2, 3), (3, 1)})],
)
def test_a_mute_node_hears_and_a_deaf_one_is_heard(
    make_scenario: MakeScenario, kind: str, heard_by: set[tuple[int, int]]
) -> None:
    air = Air(make_scenario(**{"nodes.count": 3, "faults": [{"at_s": 0, "kind": kind, "node": 2}]}), [0, 100, 200])
    for node in (1, 2, 3):
        air.send(node, 10 * node * MS)
    assert {(src, node) for node, src, _ in receptions(air.run())} == heard_by
    assert air.medium.records == [RadioFault(0, 2, 0, kind, "node-2", active=True)]
    assert lost(air) == {"station_down": 2}


@pytest.mark.parametrize("how", [{"nodes": [3, 4]}, {"line_m": [[250, -10], [250, 70]]}])
def test_no_frame_passes_a_partition_until_it_ends(make_scenario: MakeScenario, how: dict[str, object]) -> None:
    fault = {"at_s": 0.001, "kind": "partition", "for_s": 0.05, **how}
    air = Air(make_scenario(**{"nodes.count": 4, "faults": [fault]}), [0, 200, 300, 500])
    for node in range(1, 5):
        air.send(node, 10 * node * MS)
    air.send(2, 60 * MS)
    heard = [(src, node) for node, src, _ in receptions(air.run())]
    assert sorted(heard) == [(1, 2), (2, 1), (2, 1), (2, 3), (3, 4), (4, 3)], "only the last frame passes"


def test_who_has_crossed_the_line_is_on_the_other_side(make_scenario: MakeScenario) -> None:
    fault = {"at_s": 0, "kind": "partition", "line_m": [[150, 0], [150, 1]]}
    air = Air(make_scenario(**{"nodes.count": 3, "faults": [fault]}), [0, 100, 200])
    states = array("d", [value for east in (0, 100, 120) for value in (east, 0.0, 0.0, 0.0, 0.0, 0.0)])
    air.send(1, 1 * MS)
    air.medium.receive(NAMES.pose, Poses(5 * MS, array("H", [1, 2, 3]), states), 5 * MS)
    air.send(1, 10 * MS)
    assert [node for node, *_ in receptions(air.run())] == [2, 2, 3]


@pytest.mark.parametrize("channel", ["range", "log_distance"])
def test_a_fault_of_every_link_is_that_of_each(make_scenario: MakeScenario, channel: str) -> None:
    """The dice fall alike: the same frames are lost as when each pair is named."""

    def heard(faults: list[dict[str, object]]) -> list[object]:
        changes = {"nodes.count": 4, "radio.channel": channel, "faults": faults}
        air = Air(make_scenario(**changes), [0, 60, 120, 180])
        for i in range(100):
            air.send(1 + i % 4, i * 2 * MS)
        return [*receptions(air.run()), lost(air)]

    of_all = {"at_s": 0, "kind": "degrade", "loss_share": 0.3, "loss_db": 3}
    pairs = [{**of_all, "src": a, "dst": b} for a in range(1, 5) for b in range(a + 1, 5)]
    everyone, one_by_one = heard([of_all]), heard(pairs)
    assert everyone == one_by_one
    assert 0 < everyone[-1]["degraded"] < 300


@pytest.mark.parametrize("channel", ["range", "log_distance"])
def test_a_fault_that_takes_nothing_changes_nothing(make_scenario: MakeScenario, channel: str) -> None:
    """Its dice are its own: backoffs and bit errors fall as without it."""

    def outcome(*faults: Control) -> list[object]:
        air = Air(make_scenario(**{"nodes.count": 5, "radio.channel": channel}), [0, 60, 120, 180, 240])
        control(air, *faults)
        for i in range(200):
            air.send(1 + i % 5, i * 400 * US, dst=BROADCAST if i % 3 else 1 + (i + 1) % 5)
        heard = air.run()
        assert len(receptions(heard)) > 100
        return [*receptions(heard), *statuses(heard)]

    faint = Degrade("d", NodeId(1), NodeId(2), True, 0.0, 1e-12)  # noqa: FBT003
    assert outcome(faint, jam(9000, 5), cut(3), Restore("c")) == outcome()


# --- the books ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("channel", [*slow("range"), "log_distance"])
def test_the_books_close_and_repeat_under_random_faults_moves_and_loads(
    make_scenario: MakeScenario, channel: str
) -> None:
    def run() -> tuple[dict[str, object], list[tuple[int, int, int]], list[RadioFault]]:
        air = Air(make_scenario(**{"nodes.count": 8, "radio.channel": channel, "duration_s": 100}), [0.0] * 8)
        rng = random.Random(7)
        heard = []
        seq = [0] * 9
        now_ns = 0
        for _ in range(5000):
            now_ns += rng.randrange(2 * MS)
            dice = rng.randrange(20)
            if dice == 0:
                at = [(rng.uniform(0, 600), rng.uniform(0, 600)) for _ in range(8)]
                states = array("d", [v for place in at for v in (*place, 50.0, 0.0, 0.0, 0.0)])
                air.medium.receive(NAMES.pose, Poses(now_ns, array("H", range(1, 9)), states), now_ns)
            elif dice < 3:
                label, a, b = rng.choice("abcd"), NodeId(rng.randrange(1, 9)), NodeId(rng.randrange(1, 9))
                for_ns = rng.choice((0, 30 * MS))
                control(air, rng.choice((
                    Restore(label), Cut(label, a, for_ns), Cut(label, a, for_ns, hears=True),
                    Partition(label, (a, b), (0.0,) * 4, for_ns), Partition(label, (), (300.0, 0.0, 300.0, 9.0)),
                    Degrade(label, a, b, rng.random() < 0.5, rng.choice((0, 10, 200)), rng.random(), for_ns),
                    Jam(label, Enu(rng.uniform(0, 600), 0, 0), 300, rng.choice((math.inf, -90.0)), for_ns),
                )), now_ns=now_ns)  # fmt: skip
            else:
                src, dst = rng.randrange(1, 9), rng.choice((BROADCAST, NodeId(rng.randrange(1, 9))))
                request = TxRequest(
                    seq[src], now_ns + 3 * MS, PAYLOAD[: rng.randrange(1, 1000)], dst, wants_status=True
                )
                seq[src] += 1
                air.medium.receive(NAMES.radio_tx(src), request, now_ns)
            while (wake_ns := air.medium.next_wake_ns()) is not None and wake_ns <= now_ns:
                air.medium.wake(now_ns)
            heard += [m for _, m in air.medium.outbox if isinstance(m, Reception)]
            air.medium.outbox.clear()
        air.run(now_ns + 20 * S)
        return dict(air.medium.report()), [(m.src, m.end_ns, len(m.frame)) for m in heard], list(air.medium.records)

    report, heard, records = run()
    frames, copies = report["frames"], report["copies"]
    assert isinstance(frames, dict)
    assert isinstance(copies, dict)
    assert frames["in_flight"] == 0
    assert frames["sent"] == frames["delivered"] + sum(frames["dropped"].values())
    assert copies["on_air"] == copies["received"] + sum(copies["lost"].values())
    assert {"degraded", "jammed", "station_down", "collision"} <= set(copies["lost"])
    assert {"degraded", "jammed", "station_down"} <= set(frames["dropped"])
    assert run() == (report, heard, records)


def test_an_ack_takes_its_time_as_before(make_scenario: MakeScenario) -> None:
    """A fault elsewhere changes nothing here."""
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 150, 5000])
    control(air, cut(3), jam(5000, 100))
    air.send(1, 1 * MS, dst=2)
    there_ns = 1 * MS + FRAME_NS + 500
    assert statuses(air.run()) == [(1, TxOutcome.ACKED, there_ns + SIFS_NS + ACK_NS + 500, 1)]


@pytest.mark.parametrize(
    ("center", "radius_m", "deaf"),
    [((60, 80), 5, {2}), ((60, -80), 5, {3}), ((-60, 80), 5, {4}), ((0, 80), 60, {2, 4})],
)
def test_a_jammer_jams_who_is_within_its_radius_to_all_sides(
    make_scenario: MakeScenario, center: tuple[float, float], radius_m: float, deaf: set[int]
) -> None:
    air = Air(make_scenario(**{"nodes.count": 5}), [0.0] * 5)
    places = [(0, 0), (60, 80), (60, -80), (-60, 80), (-60, -80)]
    states = array("d", [value for east, north in places for value in (east, north, 50.0, 0.0, 0.0, 0.0)])
    air.medium.receive(NAMES.pose, Poses(0, array("H", range(1, 6)), states), 0)
    control(air, Jam("j", Enu(*center, 0.0), radius_m, math.inf, 0))
    air.send(1, 1 * MS)
    assert {node for node, *_ in receptions(air.run())} == {2, 3, 4, 5} - deaf


def test_what_befalls_uavs_does_not_befall_the_post(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2, "ground.at_m": [0, 0]}), [0, 100, 200])
    control(air, Mishap("node-3", NodeId(3), MishapKind.CRASH, STILL))
    assert air.medium.report()["refused"] == {"fault_unknown_node": 1}
    assert not air.medium.records


def test_a_fault_ends_at_its_instant_however_late_that_is_noticed() -> None:
    known = faults.Faults(config.build({}).radio, stations=3, uavs=3, planned=[(2 * MS, cut(2, for_ns=5 * MS))])
    known.pass_time(90 * MS)
    assert [(record.t_ns, record.active) for record in known.records] == [(2 * MS, True), (7 * MS, False)]


def test_of_two_faults_of_a_link_each_loses_its_share_of_what_the_other_lets_pass(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 2}), [0, 100])
    control(air, degrade(1, 2, share=0.2), degrade(1, 2, share=0.5)._replace(label="e"))
    arrays = air.medium._kernel.arrays
    links = zip(arrays.lk[LINK_SRC].tolist(), arrays.lk[LINK_DST].tolist(), arrays.lp[SPARED].tolist(), strict=True)
    spared = {(src, dst): share for src, dst, share in links}
    assert spared[0, 1] == pytest.approx(0.8 * 0.5)
    assert spared[1, 0] == 1.0


@pytest.mark.parametrize("what", [MishapKind.CRASH, MishapKind.BATTERY])
@pytest.mark.parametrize(
    "later", [Restore("node-2"), Restore(""), Mishap("node-2", NodeId(2), MishapKind.GPS_OFF, STILL)]
)
def test_what_befalls_a_uav_for_good_is_never_said_to_have_ended(
    make_scenario: MakeScenario, what: MishapKind, later: Control
) -> None:
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 100, 200])
    control(air, Mishap("node-2", NodeId(2), what, STILL, 5 * MS), later)
    air.run()
    told = [(record.kind, record.active) for record in air.medium.records if isinstance(record, RadioFault)]
    assert told == [(what.name.lower(), True), *([] if isinstance(later, Restore) else [("gps", True)])]
