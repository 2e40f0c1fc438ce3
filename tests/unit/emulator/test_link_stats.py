"""What links carried, as the medium tells it once a second: every copy is on its link, under what became of it."""

import json
import random
from array import array
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from test_medium_timelines import NAMES, PAYLOAD, Air

from emulator.medium import Medium
from fanet_mw.bus.link_stats import LOSSES, LinkRow, LinkStats
from fanet_mw.bus.messages import Poses, Reception, TxRequest
from fanet_mw.bus.radio_control import Degrade
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, US, NodeId, S
from sim.results.files import finish
from sim.results.links import LinkTotals
from sim.run.virtual import simulate
from sim.scenarios import catalog

MakeScenario = Callable[..., Scenario]


def stats(air: Air, until_ns: int = 10 * S) -> tuple[list[LinkStats], list[Reception]]:
    """What the medium said of links, and the frames it handed over."""
    messages = [heard.message for heard in air.run(until_ns)]
    return [m for m in messages if isinstance(m, LinkStats)], [m for m in messages if isinstance(m, Reception)]


def lost(row: LinkRow) -> dict[str, int]:
    return {reason.value: count for reason, count in zip(LOSSES, row.lost, strict=True) if count}


def test_each_second_with_traffic_is_told_once_with_the_links_that_carried_it(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 3, "radio.channel": "log_distance"}), [0, 100, 2000])
    for at_ns in (100 * MS, 200 * MS, 1500 * MS, 4 * S + 1):
        air.send(1, at_ns)
    told, heard = stats(air)
    assert [(m.t_ns, m.span_ns) for m in told] == [(1 * S, 1 * S), (2 * S, 1 * S), (5 * S, 3 * S)]
    rows = [list(m.rows()) for m in told]
    assert [[(row.src, row.dst, row.copies, row.received) for row in second] for second in rows] == [
        [(1, 2, 2, 2)], [(1, 2, 1, 1)], [(1, 2, 1, 1)],
    ]  # fmt: skip
    assert rows[0][0].rssi_dbm == pytest.approx(heard[0].rssi_dbm, abs=0.001)


def test_an_emulator_that_starts_in_mid_run_knows_the_planned_faults_and_reports_from_then_on(
    make_scenario: MakeScenario,
) -> None:
    faults = [{"at_s": 3, "kind": "cut", "node": 3}, {"at_s": 4, "kind": "cut", "node": 1, "for_s": 5}]
    scenario = make_scenario(**{"nodes.count": 3, "duration_s": 100, "faults": faults})
    air = Air(scenario, [0, 100, 200])
    air.medium = Medium(scenario, "test")
    air.medium.start(20 * S + 500 * MS)
    air.place([0, 100, 200], 20 * S + 500 * MS)
    air.send(1, 20 * S + 600 * MS, now_ns=20 * S + 500 * MS)
    (told,), heard = stats(air, 30 * S)
    assert (told.t_ns, told.span_ns) == (21 * S, 500 * MS)
    assert [(row.src, row.dst, row.received, lost(row)) for row in told.rows()] == [
        (1, 2, 1, {}), (1, 3, 0, {"station_down": 1}),
    ]  # fmt: skip
    assert len(heard) == 1


def test_a_copy_that_is_lost_is_on_its_link_with_its_reason(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 3}), [0, 200, 400])
    air.send(1, 1 * MS)
    air.send(3, 1 * MS + 500 * US)
    air.medium.receive(NAMES.radio_control, Degrade("d", NodeId(2), NodeId(1), False, 0.0, 1.0), 0)  # noqa: FBT003
    air.send(2, 10 * MS)
    (told,), _ = stats(air)
    assert {(row.src, row.dst): (row.received, lost(row)) for row in told.rows()} == {
        (1, 2): (0, {"collision": 1}), (2, 1): (0, {"degraded": 1}), (2, 3): (1, {}), (3, 2): (0, {"collision": 1}),
    }  # fmt: skip
    assert [row.rssi_dbm for row in told.rows()] == [None, None, None, None], "this channel knows no powers"


def test_what_all_links_carried_is_what_the_air_carried_whatever_moves(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**{"nodes.count": 8, "duration_s": 100}), [0.0] * 8)
    rng = random.Random(3)
    told: list[LinkStats] = []
    seq = [0] * 9
    now_ns = 0
    for _ in range(3000):
        now_ns += rng.randrange(2 * MS)
        if rng.randrange(10) == 0:
            at = [(rng.uniform(0, 500), rng.uniform(0, 500)) for _ in range(8)]
            states = array("d", [v for place in at for v in (*place, 50.0, 0.0, 0.0, 0.0)])
            air.medium.receive(NAMES.pose, Poses(now_ns, array("H", range(1, 9)), states), now_ns)
        else:
            src, dst = rng.randrange(1, 9), rng.choice((BROADCAST, NodeId(rng.randrange(1, 9))))
            request = TxRequest(seq[src], now_ns + 2 * MS, PAYLOAD[: rng.randrange(1, 900)], dst, wants_status=False)
            seq[src] += 1
            air.medium.receive(NAMES.radio_tx(src), request, now_ns)
        while (wake_ns := air.medium.next_wake_ns()) is not None and wake_ns <= now_ns:
            air.medium.wake(now_ns)
        told += [m for _, m in air.medium.outbox if isinstance(m, LinkStats)]
        air.medium.outbox.clear()
    told += stats(air, now_ns + 20 * S)[0]
    copies = air.medium.report()["copies"]
    sums = [0] * (1 + len(LOSSES))
    for message in told:
        for row in message.rows():
            sums = [a + b for a, b in zip(sums, (row.received, *row.lost), strict=True)]
    assert sums[0] == copies["received"] > 1000
    assert {reason.value: count for reason, count in zip(LOSSES, sums[1:], strict=True) if count} == copies["lost"]
    assert sum(m.span_ns for m in told) == told[-1].t_ns


def test_the_links_of_a_run_are_a_file_that_adds_up_to_its_copies(tmp_path: Path) -> None:
    outcome = simulate(catalog.find("quick", ["duration_s=6", "drain_s=0.5"]))
    copies = finish(outcome, out=tmp_path)["copies"]
    links = json.loads((tmp_path / "links.json").read_text(encoding="utf-8"))
    assert sum(link["received"] for link in links) == copies["received"] > 100
    lost: Counter[str] = Counter()
    for link in links:
        assert link["copies"] == link["received"] + sum(link["lost"].values())
        assert link["rssi_dbm"] is None, "a channel that knows only a range has no powers"
        lost.update(link["lost"])
    assert lost == copies["lost"]


def test_sums_over_a_long_run_are_of_all_reports() -> None:
    totals = LinkTotals()
    for second in range(1, 151):
        ends, counts = array("H", [1, 2, 2, 1]), array("I", [3, 1, 0, 0, 0, 0, 0, 1, 0, 0, 2, 0, 0, 0])
        totals.add(LinkStats(second * S, S, ends, counts, array("q", [-180_000, -50_000])))
    there, back = totals.rows()
    assert (there.src, there.dst, there.received, there.copies) == (1, 2, 450, 600)
    assert (back.src, back.dst, back.received, back.copies) == (2, 1, 150, 450)
    assert (there.rssi_dbm, back.rssi_dbm) == (-60.0, -50.0)
