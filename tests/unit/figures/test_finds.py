"""What a report tells an incident commander, on records that were written by hand."""

from pathlib import Path

import pytest
from kit import MakeScenario

from fanet_mw.errors import ConfigError
from fanet_mw.trace import Approaching, Confirmed, Detected, PlacedInside, Posed, Record, Refuted
from fanet_mw.units import Enu, S
from fanet_mw.wire.survivors import Found, Standing, person_id
from sim.report import finds
from sim.report.html import Rows, as_html
from sim.report.run_records import RunRecords
from sim.results.files import finish
from sim.results.mission import Confirmations, CoveredCells
from sim.results.outcome import Outcome
from sim.results.run_folder import RunFolder

KEYS = {
    "nodes.count": 2, "nodes.altitude_m": 60, "world.area_m": 1000, "duration_s": 60, "mission.survivors": 6,
    "mission.survivor_positions_m": [[0, 0], [100, 0], [-100, 0], [200, 0], [300, 300], [400, -400]],
}  # fmt: skip
PERSON = person_id(2, 0)
RECORDS: list[Record] = [
    Detected(1 * S, 1, 1, -80.0), Approaching(2 * S, 1, 1, 1, 30.0, 9.0), Confirmed(9 * S, 2, 1, 3.0, 4.0),
    Detected(3 * S, 1, 2, -80.0), Confirmed(5 * S, 1, 2, 160.0, 0.0), Refuted(8 * S, 2, 2, 160.0, 0.0),
    Detected(4 * S, 2, 3, -80.0), Approaching(6 * S, 2, 3, 2, -60.0, 30.0),
    Detected(7 * S, 2, 4, -90.0),
    PlacedInside(10 * S, 1, 5, 310.0, 305.0),
    Confirmed(11 * S, 2, PERSON, 4.0, 2.0), Confirmed(12 * S, 2, PERSON + 1, -400.0, 5.0),
]  # fmt: skip


def run_of(make_scenario: MakeScenario, *more: Record) -> RunRecords:
    run = RunRecords(make_scenario(**KEYS))
    run.read([*RECORDS, *more])
    return run


def folder_of(run: RunRecords, taps: list[tuple[int, bytes]], path: Path) -> RunFolder:
    """The folder of a run with this telemetry."""
    finish(Outcome(run.scenario, "virtual", 1.0, RECORDS, {}, taps), out=path)
    return RunFolder(path)


def test_the_last_word_about_each_survivor_with_place_time_and_uav(make_scenario: MakeScenario) -> None:
    known = finds.finds(run_of(make_scenario))
    told = [(one.survivor, one.said, one.at, one.said_ns // S, one.node) for one in known]
    assert told == [
        (1, "confirmed", (3.0, 4.0), 9, 2),
        (PERSON, "confirmed", (4.0, 2.0), 11, 2),
        (PERSON + 1, "confirmed", (-400.0, 5.0), 12, 2),
        (3, "estimated", (-60.0, 30.0), 6, 2),
        (4, "heard", None, 7, 2),
        (2, "taken back", (160.0, 0.0), 8, 2),
        (5, "inside a building", (310.0, 305.0), 10, 1),
    ]
    assert [one.heard_ns for one in known if one.survivor in (1, 5)] == [1 * S, None]


@pytest.mark.parametrize(("east_m", "said"), [(160.0, "taken back"), (161.0, "taken back"), (220.0, "confirmed")])
def test_what_takes_a_find_back_is_what_takes_it_back_in_the_summary(
    make_scenario: MakeScenario, east_m: float, said: str
) -> None:
    news = [Confirmed(20 * S, 1, 4, 160.0, 300.0), Refuted(30 * S, 2, 4, east_m, 299.0)]
    (found,) = (one for one in finds.finds(run_of(make_scenario, *news)) if one.survivor == 4)
    counted = Confirmations([Enu(0.0, 0.0, 0.0)] * 6)
    for record in news:
        counted.add(record)
    assert (found.said, len(counted.mistaken())) == (said, int(said == "confirmed"))


def test_a_person_where_a_survivor_is_confirmed_is_left_out_and_counted(make_scenario: MakeScenario) -> None:
    known, doubles = finds.without_doubles(finds.finds(run_of(make_scenario)))
    assert doubles == 1
    assert PERSON not in {one.survivor for one in known}
    assert PERSON + 1 in {one.survivor for one in known}


def test_how_sure_is_what_uavs_told_each_other(make_scenario: MakeScenario, tmp_path: Path) -> None:
    told = [
        Found(13_000_000, 3, -95.0, 5.0, 100.0, 0.0, 36.0, 2, Standing.ESTIMATED),
        Found(9_000_000, 1, 3.0, 4.0, 4.0, 0.0, 4.0, 2, Standing.CONFIRMED),
    ]
    taps = [(one.t_us * 1000, one.encode_frame(one.node)) for one in told]
    run = run_of(make_scenario)
    known = finds.with_estimates(finds.finds(run), finds.told(folder_of(run, taps, tmp_path)))
    rows = {row[0]: row for row in finds.found_rows(run, known).rows}
    assert rows["survivor 3"][1] == "95 W, 5 N"
    assert rows["survivor 3"][3] == "by phone alone, within 25 m (95 %)"
    assert rows["survivor 3"][5:] == ["13 s", "UAV 2", "7 m"]
    assert rows["survivor 1"][3] == "confirmed at close range, within 7 m (95 %)"
    assert rows["survivor 1"][7] == "5 m"
    assert rows["survivor 4"][1:4] == ["-", "-", "phone heard, no place yet"]
    lat, lon = map(float, rows["survivor 3"][2].split(", "))
    south, west = map(float, rows["survivor 1"][2].split(", "))
    assert (lat - south, lon < west) == (pytest.approx(1 / 111_000, rel=0.05), True)


def test_without_telemetry_an_estimate_is_rough(make_scenario: MakeScenario, tmp_path: Path) -> None:
    run = run_of(make_scenario)
    known = finds.with_estimates(finds.finds(run), finds.told(folder_of(run, [], tmp_path)))
    rows = {row[0]: row for row in finds.found_rows(run, known).rows}
    assert rows["survivor 3"][3] == "by phone alone, roughly"


def test_telemetry_that_is_not_the_runs_is_refused(make_scenario: MakeScenario, tmp_path: Path) -> None:
    folder = folder_of(run_of(make_scenario), [(1000, b"")], tmp_path)
    path = tmp_path / "mavlink.tlog"
    path.unlink()
    path.symlink_to("/dev/zero")
    with pytest.raises(ConfigError, match=r"mavlink\.tlog: cannot be read"):
        finds.told(folder)
    path.unlink()
    path.write_bytes(b"else")
    with pytest.raises(ConfigError, match="is not the file that was written"):
        finds.told(folder)


def test_who_was_missed_is_named(make_scenario: MakeScenario) -> None:
    run = run_of(make_scenario)
    assert "Nobody has heard of 1 of 6: 6." in finds.missed_sentence(run, finds.finds(run), 0)


def test_what_is_not_searched_is_told_by_piece(make_scenario: MakeScenario) -> None:
    line = [Posed(second * S, 1, -500.0 + 10 * second, -250.0, 60.0) for second in range(101)]
    run = run_of(make_scenario, *line)
    share, pieces = finds.unsearched(run)
    cells = CoveredCells(run.scenario)
    cells.add((one.east_m, one.north_m, one.up_m) for one in line)
    assert share == pytest.approx(1 - cells.share)
    assert sum(piece.area_m2 for piece in pieces) == pytest.approx(share * 1e6)
    north = pieces[0]
    assert (north.west, north.east, north.north) == (-500, 500, 500)
    assert -250 < north.south <= 0
    assert all(piece.north <= north.south for piece in pieces[1:])
    rows = finds.unsearched_rows(share, pieces)
    assert rows.rows[0][0] == f"{north.area_m2 / 1e4:.1f} ha"


def test_a_wide_table_is_cards_on_a_phone_with_the_name_of_each_column() -> None:
    names = ("who", "where", "how sure", "when", "by")
    page = as_html(
        "A page", [Rows(names, [["survivor 1", "3 E", "close", "9 s", "UAV 2"]]), Rows(("a", "b"), [["1", "2"]])]
    )
    assert page.count("<table class=cards>") == 1
    assert all(f'data-column="{name}"' in page for name in names)
    assert page.count("data-column=") == len(names)
