"""The page of one run: its rows and its pictures, from records written by hand."""

import re
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from kit import MakeScenario
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from fanet_mw.trace import (
    BoundStated,
    Confirmed,
    Delivered,
    Detected,
    Generated,
    KnownOnGround,
    LetOut,
    Posed,
    Record,
    Refuted,
    RoleChanged,
)
from fanet_mw.units import MS, S
from sim.report import mission_pictures, run_pictures, run_rows, slot_pictures
from sim.report.run_records import RunRecords
from sim.results.mission import mission
from sim.run.virtual import simulate

SEARCH = {
    "nodes.count": 2, "world.area_m": 400, "mission.survivors": 2, "mission.survivor_positions_m": [[0, 100], [50, 0]],
    "mission.search": "lines",
}  # fmt: skip
FOUND: tuple[Record, ...] = (
    *(Posed(second * S, node, -100.0 + 10 * second, 40.0 * node, 30.0) for second in range(11) for node in (1, 2)),
    Detected(2 * S, 1, 1, -60.0),
    Detected(3 * S, 2, 2, -60.0),
    Confirmed(4 * S, 1, 1, 0.0, 98.0),
    Confirmed(5 * S, 2, 2, -150.0, 0.0),
    Refuted(6 * S, 2, 2, -150.0, 0.0),
    Confirmed(7 * S, 2, 2, 50.0, 3.0),
)


def in_order(records: Iterable[Record]) -> list[Record]:
    return sorted(records, key=lambda record: record.t_ns)


def run_of(scenario: Any, *records: Record) -> RunRecords:
    run = RunRecords(scenario)
    run.read(in_order(records))
    return run


def drawn(figure: Figure) -> dict[str, list[tuple[float, float]]]:
    """The lines of a figure with labels, as points."""
    return {
        str(line.get_label()): [(float(x), float(y)) for x, y in np.asarray(line.get_data()).T.tolist()]
        for axes in figure.axes
        for line in axes.lines
    }


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for box in figure.legends for text in box.get_texts()]


def test_a_confirmation_counts_from_its_instant_if_it_is_right_and_nothing_has_an_empty_legend_entry(
    make_scenario: MakeScenario,
) -> None:
    drawing = mission_pictures.progress(run_of(make_scenario(**SEARCH), *FOUND))
    assert drawing is not None
    assert drawn(drawing.figure)["confirmed"] == [(0, 0), (4, 1), (7, 2), (10, 2)], "one at 5 s was far from the person"
    assert drawn(drawing.figure)["detected"] == [(0, 0), (2, 1), (3, 2), (10, 2)]
    assert legend(drawing.figure) == ["detected", "confirmed", "all 2 survivors"]
    assert "No survivor was approached or reached." in drawing.caption


def test_coverage_over_time_ends_at_that_of_the_summary(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**SEARCH)
    drawing = mission_pictures.progress(run_of(scenario, *FOUND))
    assert drawing is not None
    times, shares = np.asarray(drawing.figure.axes[1].lines[0].get_data()).tolist()
    assert times == list(range(11))
    assert shares[-1] == pytest.approx(mission(scenario, in_order(FOUND))["coverage"], abs=1e-6)
    assert shares[0] < shares[-1], "the UAVs fly on"


def test_the_wait_of_each_survivor_is_drawn_until_the_post_knows(make_scenario: MakeScenario) -> None:
    told = KnownOnGround(6 * S, 3, 1, 0.0, 98.0)
    drawing = mission_pictures.waits(run_of(make_scenario(**SEARCH, **{"ground.at_m": (0.0, -150.0)}), *FOUND, told))
    assert drawing is not None
    axes = drawing.figure.axes[0]
    bars = [bar.get_window_extent().transformed(axes.transData.inverted()) for bar in axes.patches]
    assert [(round(bar.x0, 3), round(bar.x1, 3)) for bar in bars] == [(2, 4), (4, 6), (3, 7)]
    assert legend(drawing.figure) == ["heard, until confirmed", "known at the post"]
    assert drawing.caption.endswith("at most 4 s.")
    assert mission_pictures.waits(run_of(make_scenario(**SEARCH), *FOUND[:20])) is None, "nobody was heard"


def test_the_map_shows_tracks_and_where_each_survivor_was_confirmed(make_scenario: MakeScenario) -> None:
    drawing = mission_pictures.tracks(run_of(make_scenario(**SEARCH), *FOUND))
    assert drawing is not None
    at = {str(one.get_label()): np.asarray(one.get_offsets()).tolist() for one in drawing.figure.axes[0].collections}
    assert at["place confirmed"] == [[0, 98], [50, 3]]
    assert at["survivor, confirmed"] == [[0, 100], [50, 0]]
    assert at["UAVs at the end"] == [[0, 40], [0, 80]]
    assert not [label for label in at if "mistake" in label or "not confirmed" in label]


def test_the_rows_of_a_search_name_what_it_achieved_in_readable_numbers(make_scenario: MakeScenario) -> None:
    found = run_rows.mission({"mission": mission(make_scenario(**SEARCH), in_order(FOUND))}, confirms=True)
    rows = {row[0]: row[1] for row in found.rows}
    assert rows["survivors confirmed, within 25 m of the true place"] == "2 of 2"
    assert rows["time to confirm: first, median, last"] == "4 s, 5.5 s, 7 s"
    assert rows["confirmations taken back"] == "1"
    assert {"area covered", "time in which all searching UAVs were connected"} <= rows.keys()
    assert rows["distance to the nearest other UAV: least, 1st percentile, median"] == "40 m, 40 m, 40 m"


def test_numbers_have_units_and_no_exponents() -> None:
    assert [run_rows.milliseconds(value) for value in (None, 0.0412, 304.4, 9_999.4, 12_413.0)] == [
        "-", "0.0412 ms", "304 ms", "9,999 ms", "12.4 s",
    ]  # fmt: skip
    assert [run_rows.percent(share) for share in (None, 0.0, 0.66251, 0.99999, 1.0)] == [
        "-", "0 %", "66.25 %", "more than 99.99 %", "100 %",
    ]  # fmt: skip


def test_links_are_drawn_between_the_places_of_a_stated_window(make_scenario: MakeScenario) -> None:
    """Both UAVs fly 100 m to the east within 10 s, of which the last 4 s belong to the drain."""
    scenario = make_scenario(**SEARCH, **{"drain_s": 4, "radio.range_m": 50})
    links = [{"src": 1, "dst": 2, "copies": 4, "received": 3}]
    drawing = run_pictures.links(run_of(scenario, *FOUND), links)
    assert drawing is not None
    (nodes,) = (one for one in drawing.figure.axes[0].collections if one.get_label() == "node")
    assert np.asarray(nodes.get_offsets()).tolist() == [[-70, 40], [-70, 80]]
    assert "at their mean places from 0 to 6 s" in drawing.caption
    assert (
        "1 directed links between nodes that were within 50 m of each other there, the radio's reach" in drawing.caption
    )


def test_packets_are_held_against_the_slots_of_their_heads_in_the_whole_run(make_scenario: MakeScenario) -> None:
    """Two slots of 500 ms. Head 3 keeps to its slot, head 2 once does not; node 4 succeeds it as head of slot 1."""
    run = run_of(
        make_scenario(**{"nodes.count": 4, "clusters.count": 2, "clusters.flooding_period_s": 1}),
        *(RoleChanged(S, node, "head", cluster, node) for cluster, node in enumerate((2, 3))),
        RoleChanged(3500 * MS, 4, "head", 0, 4),
        RoleChanged(3600 * MS, 2, "member", 0, 4),
        *(Generated(S, node, seq, "traffic", 9) for node in (2, 3) for seq in (1, 2)),
        LetOut(1100 * MS, 2, 0),
        LetOut(2300 * MS, 2, 1),
        LetOut(2800 * MS, 2, 2),
        LetOut(2700 * MS, 3, 1),
        LetOut(4600 * MS, 3, 2),
        LetOut(2900 * MS, 4, 1),
        LetOut(4499 * MS, 4, 1),
        LetOut(4700 * MS, 2, 3),
    )
    slots = {"start_ms": 4000.0, "period_ms": 1000.0, "slot_ms": 500.0, "guard_ms": 2.0}
    drawing = slot_pictures.slots(run, {3: {"slots": slots, "role": "head", "cluster": 1}})
    assert drawing is not None
    assert "Of 6 packets of heads, 4 were let out in the slot of their cluster" in drawing.caption, "499 is guard time"
    assert [text.get_text() for text in drawing.figure.axes[0].texts] == ["slot 1", "slot 2"]
    assert legend(drawing.figure) == ["packets of members", "of the head of slot 1", "of the head of slot 2"]
    points = [np.asarray(marks.get_offsets()).tolist() for marks in drawing.figure.axes[0].collections]
    assert points == [
        [[900, 2.9], [700, 4.7]], [[100, 1.1], [300, 2.3], [800, 2.8], [499, 4.499]], [[700, 2.7], [600, 4.6]],
    ]  # fmt: skip


@pytest.mark.slow
def test_packets_in_rounds_are_let_out_in_the_turn_of_their_origin_or_in_a_bulk_slot(
    make_scenario: MakeScenario,
) -> None:
    scenario = make_scenario(**{
        "nodes.count": 4, "nodes.spacing_m": 50, "duration_s": 6, "warmup_s": 2, "drain_s": 1, "traffic.interval_s": 1,
        "routing.protocol": "rounds", "radio.lead_ms": 0, "traffic.payload_bytes": 300,
        "mission.survivors": 3, "mission.report_interval_s": 0.5,
    })  # fmt: skip
    drawing = slot_pictures.slots(run_of(scenario, *simulate(scenario).records), {})
    assert drawing is not None
    found = re.search(
        r"Of (\d+) packets, (\d+) were let out in a turn of the origin, (\d+) in the slots", drawing.caption
    )
    assert found is not None
    whole, urgent, bulk = map(int, found.groups())
    assert urgent > 5
    assert bulk > 5
    assert whole == urgent + bulk
    assert set(legend(drawing.figure)) == {"packets", "slots of bulk", "the owner's turn"}


def test_turns_are_shaded_behind_the_contention_window_each_on_the_line_of_its_owner(
    make_scenario: MakeScenario,
) -> None:
    """Turns of 50 ms behind a window of 100 ms in a period of 400 ms; the one with offset 7 passes its end."""
    frame = {"start_ms": 1000.0, "period_ms": 400.0, "turn_ms": 50.0, "contention_ms": 100.0}
    reports = {1: {"turns": {**frame, "own": [0, 3]}}, 2: {"turns": {**frame, "own": [7]}}, 3: {"turns": None}}
    run = run_of(
        make_scenario(**{"nodes.count": 3}),
        *(Generated(S, node, 1, "traffic", 9) for node in (1, 2)),
        LetOut(1120 * MS, 1, 1),
        LetOut(1220 * MS, 2, 1),
    )
    drawing = slot_pictures.slots(run, reports)
    assert drawing is not None
    bars = [
        (bar.get_x(), bar.get_width(), bar.get_y() + bar.get_height() / 2)
        for bar in drawing.figure.axes[0].patches
        if isinstance(bar, Rectangle) and bar.get_label() != "contention window"
    ]
    assert bars == [(50, 50, 2), (100, 50, 1), (250, 50, 1)]
    assert "Of 2 packets of nodes with turns, 1 were let out in a turn of the origin." in drawing.caption


def test_a_last_timetable_that_came_too_late_leaves_the_packets_over_the_time_of_the_run(
    make_scenario: MakeScenario,
) -> None:
    frame = {"start_ms": 9000.0, "period_ms": 400.0, "turn_ms": 50.0, "contention_ms": 100.0, "own": [0]}
    run = run_of(make_scenario(**{"nodes.count": 3}), LetOut(1120 * MS, 1, 1), LetOut(1220 * MS, 2, 1))
    drawing = slot_pictures.slots(run, {1: {"turns": frame}})
    assert drawing is not None
    assert "in force for 0 of 2 packets" in drawing.caption
    (drawn_packets,) = drawing.figure.axes[0].collections
    assert np.asarray(drawn_packets.get_offsets()).tolist() == [[1.12, 1], [1.22, 2]]


def test_reports_have_a_line_of_their_own_with_their_bounds_beside_the_load(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 3, "duration_s": 20})
    records = [
        Generated(S, 1, 1, "traffic", 100), Generated(2 * S, 2, 1, "report", 50),
        BoundStated(2 * S, 2, 1, 900 * MS), Delivered(3 * S, 2, 1, 1, 2 * S, 1), Delivered(4 * S, 3, 1, 1, 3 * S, 1),
        Delivered(2 * S + 300 * MS, 1, 2, 1, 300 * MS, 1), Delivered(2 * S + 700 * MS, 3, 2, 1, 700 * MS, 2),
    ]  # fmt: skip
    drawing = run_pictures.delays(run_of(scenario, *records))
    assert drawing is not None
    assert drawn(drawing.figure) == {
        "delay of load": [(2000, 0.5), (3000, 1)], "delay of reports": [(300, 0.5), (700, 1)],
        "bound of reports": [(900, 1)],
    }  # fmt: skip
    assert legend(drawing.figure) == [*drawn(drawing.figure)]


def test_bounds_are_kept_of_those_that_were_stated() -> None:
    bound = {"within_share": 0.1, "stated_share": 0.125, "violations": 7, "never": 4}
    assert list(run_rows._bounds(bound)) == [
        ("packets x targets for which a bound was stated", "12.5 %"),
        ("of these, delivered within their bound", "80 %"),
        ("of these, later than their bound or never; the rest had time left when the run ended", "7"),
    ]
    assert list(run_rows._bounds(bound | {"overtaken": 5}))[2:] == [
        ("of these, later than their bound or never; the rest had time left when the run ended", "2"),
        ("late or lost likewise, because a fault overtook them", "5"),
    ]


GROUND = {"ground.at_m": [-70, 0], "ground.gain_dbi": 20.0}


def test_the_post_and_the_reach_of_its_antenna_are_on_the_map_of_a_swarm_that_flies(
    make_scenario: MakeScenario,
) -> None:
    scenario = make_scenario(**SEARCH, **GROUND, **{"drain_s": 4, "radio.range_m": 50})
    links = [{"src": src, "dst": dst, "copies": 4, "received": 3} for src, dst in ((1, 2), (2, 3), (3, 2))]
    drawing = run_pictures.links(run_of(scenario, *FOUND), links)
    assert drawing is not None
    (nodes,) = (one for one in drawing.figure.axes[0].collections if one.get_label() == "node")
    assert np.asarray(nodes.get_offsets()).tolist() == [[-70, 40], [-70, 80], [-70, 0]]
    assert "Drawn are the 3 directed links between nodes that were within 50 m (500 m from the post)" in drawing.caption
    assert "0 other pairs" in drawing.caption


def test_the_post_has_its_line_among_the_turns(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 3, "routing.protocol": "rounds", **GROUND})
    drawing = slot_pictures.slots(run_of(scenario, LetOut(S, 4, 1)), {})
    assert drawing is not None
    assert drawing.figure.axes[0].get_ylim()[1] > 4


def test_a_report_to_all_is_for_the_post_too(make_scenario: MakeScenario) -> None:
    records = [
        Generated(S, 1, 1, "report", 50),
        *(Delivered(S + node * MS, node, 1, 1, node * MS, 1) for node in (2, 3)),
    ]
    drawing = run_pictures.delays(run_of(make_scenario(**{"nodes.count": 2, "duration_s": 20, **GROUND}), *records))
    assert drawing is not None
    assert drawing.figure.axes[0].lines[0].get_ydata().tolist() == [0.5, 1.0]  # type: ignore[union-attr]


def test_the_first_load_is_drawn_whatever_its_name(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 2, "duration_s": 20, "traffic.name": "video"})
    records = [Generated(S, 1, 1, "video", 100), Delivered(2 * S, 2, 1, 1, S, 1)]
    drawing = run_pictures.delays(run_of(scenario, *records))
    assert drawing is not None
    assert run_pictures.delivery(run_of(scenario, *records)) is not None


def test_where_the_places_of_survivors_are_not_known_nobody_is_said_not_to_be_confirmed(
    make_scenario: MakeScenario,
) -> None:
    run = run_of(make_scenario(**SEARCH), *FOUND)
    run.survivors, run.unplaced = (), "its map is gone"
    drawing = mission_pictures.progress(run)
    assert drawing is not None
    assert "No survivor was approached or reached." in drawing.caption
    assert mission_pictures.waits(run) is None
