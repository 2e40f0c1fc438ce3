"""Scenario files: every mistake at once, by file, key, value and bound."""

import math
import re
from pathlib import Path

import pytest

from agents.applications.telemetry_streams import TelemetryStreams
from fanet_mw import wire
from fanet_mw.errors import ConfigError
from fanet_mw.mavlink import Encoder
from fanet_mw.scenario import Scenario, config, grid_columns
from fanet_mw.scenario.cross_checks import MESSAGE_BYTES
from fanet_mw.units import Enu, NodeId, S
from sim.cli.app import app
from sim.scenarios import catalog


def refusal(text: str, *overrides: str) -> str:
    with pytest.raises(ConfigError) as caught:
        config.parse(text, source="a.toml", name="a", overrides=overrides)
    return str(caught.value)


def test_three_mistakes_are_reported_at_once_with_file_key_value_and_bound() -> None:
    message = refusal('duration_s = -1\n[nodes]\ncuont = 4\nlayout = "hexagon"\n')
    lines = message.splitlines()
    assert len(lines) == 3
    assert all(line.startswith("a.toml: ") for line in lines)
    assert "duration_s = -1: input should be greater than or equal to 0.001" in message
    assert "nodes.cuont: unknown key; did you mean count?" in message
    assert "nodes.layout = 'hexagon'" in message
    assert "'disc'" in message


def test_what_tables_disagree_about_is_reported_with_both_keys() -> None:
    message = refusal("[nodes]\ncount = 5\n[clusters]\ncount = 9\n[traffic]\ndestination = 7\n")
    assert "clusters.count = 9 must be < nodes.count = 5" in message
    assert "traffic.destination = 7 must be <= nodes.count = 5" in message


def test_a_source_that_is_the_destination_is_refused_because_its_first_packet_would_end_the_run() -> None:
    message = refusal("[traffic]\nsources = [2, 3]\ndestination = 3\n")
    assert "traffic.sources = [2, 3] must not name traffic.destination = 3" in message


@pytest.mark.parametrize("keys", ["return_after_s = 5", 'geofence = "return"'])
def test_a_return_of_uavs_that_need_no_setpoints_is_refused(keys: str) -> None:
    message = refusal(f'[mobility]\nmodel = "formation"\n{keys}\n')
    assert "a return needs mobility.model = \"onboard\", not 'formation'" in message
    config.parse(f'[mobility]\nmodel = "onboard"\n{keys}\n', source="a.toml", name="a")


@pytest.mark.parametrize("model", ["formation", "random_waypoint", "crossing"])
def test_uavs_on_the_ground_that_nobody_would_let_take_off_are_refused(model: str) -> None:
    message = refusal(f'[nodes]\non_ground = true\n[mobility]\nmodel = "{model}"\n')
    assert f"nodes.on_ground = true: UAVs that follow mobility.model = '{model}' do not take off" in message


def test_a_guard_longer_than_its_slot_is_refused() -> None:
    assert "guard_ms = 2000" in refusal("[clusters]\nguard_ms = 2000\nflooding_period_s = 5\ncount = 4\n")


def test_an_unknown_rate_names_the_known_ones() -> None:
    assert "must be one of 1, 2, 5.5, 11" in refusal("[radio]\nrate_mbps = 3\n")


def test_broken_toml_names_file_and_line() -> None:
    assert "a.toml: not valid TOML" in refusal("[nodes\ncount=3")


def test_a_file_that_is_missing_is_named() -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.toml: cannot be read"):
        config.load(Path("nowhere.toml"))


def test_an_unknown_scenario_suggests_the_nearest_shipped_one() -> None:
    with pytest.raises(ConfigError, match="did you mean rescue"):
        catalog.find("recsue")


@pytest.mark.parametrize("entry", catalog.shipped(), ids=lambda entry: entry.name)
def test_every_shipped_scenario_is_valid_and_describes_itself(entry: catalog.Entry) -> None:
    scenario = catalog.find(entry.name)
    assert scenario.name == entry.name
    assert scenario.description


def test_a_resolved_scenario_is_read_back_as_itself() -> None:
    scenario = catalog.find("rescue")
    assert Scenario.model_validate(scenario.model_dump(mode="json")) == scenario


@pytest.mark.parametrize(("count", "columns"), [(45, 9), (9, 3), (100, 10), (1, 1), (7, 7), (47, 10)])
def test_the_default_grid_is_near_nine_by_five(count: int, columns: int) -> None:
    assert grid_columns(count) == columns


def test_the_sizes_of_messages_that_a_scenario_is_checked_with_are_those_of_the_air() -> None:
    node = NodeId(5)
    positions = TelemetryStreams(node, position=Enu(1, 2, 3), telemetry_hz=0).beacon_frames(0)
    warning = Encoder(node).collision(NodeId(3), closest_s=1, altitude_m=1, horizontal_m=1)
    specs = (wire.ROUTE, wire.BEACON, wire.SCHEDULE, wire.SURVIVOR, wire.DIGEST, wire.PLACES, wire.LINKS,
             wire.LOADS)  # fmt: skip
    names = {53000: "ROUTE", 53001: "BEACON", 53002: "SCHEDULE", 53003: "SURVIVOR", 53007: "DIGEST", 53008: "PLACES",
             53011: "LINKS", 53015: "LOADS"}  # fmt: skip
    sizes = {f"FANET_{names[spec.msgid]}": wire.OVERHEAD + spec.layout.size for spec in specs}
    assert {**sizes, "positions": len(positions), "COLLISION": len(warning)} == MESSAGE_BYTES


def test_a_search_by_uavs_that_do_not_fly_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"mission.search = .* needs mobility.speed_m_s > 0"):
        catalog.find("rescue", ["mobility.speed_m_s=0"])
    with pytest.raises(ConfigError, match=r"mission.search = .* needs nodes.altitude_m > 0"):
        catalog.find("rescue", ["nodes.altitude_m=0"])


def test_a_search_above_its_ceiling_is_refused() -> None:
    assert catalog.find("rescue", ["nodes.altitude_m=120"]).mission.ceiling_m == 120
    with pytest.raises(ConfigError, match=r"nodes.altitude_m = 121 must be <= mission.ceiling_m = 120"):
        catalog.find("rescue", ["nodes.altitude_m=121"])
    catalog.find("rescue", ["nodes.altitude_m=121", "mission.search=none"])


def test_a_search_in_lines_by_too_few_uavs_is_refused_with_the_number_that_it_needs() -> None:
    with pytest.raises(ConfigError, match=r"nodes\.count = 12: .* needs at least (\d+) UAVs") as refused:
        catalog.find("rescue", ["nodes.count=12", "traffic.sources=11"])
    least = int(re.search(r"at least (\d+)", str(refused.value))[1])  # type: ignore[index]
    assert catalog.find("rescue", [f"nodes.count={least}", f"traffic.sources={least - 1}"]).nodes.count == least
    with pytest.raises(ConfigError, match="needs at least"):
        catalog.find("rescue", [f"nodes.count={least - 1}", f"traffic.sources={least - 2}"])


def test_a_search_of_phones_that_are_hardly_received_is_refused_for_them_too() -> None:
    phones = r"range_m = 250 and phones received within \d+ m of a lane \(mission\.detection_dbm = -73, "
    with pytest.raises(ConfigError, match=phones):
        catalog.find("rescue", ["mission.detection_dbm=-73"])
    with pytest.raises(ConfigError, match=r"UAVs with radio\.range_m = 120$"):  # so lanes are near enough for phones
        catalog.find("rescue", ["radio.range_m=120", "nodes.count=12", "traffic.sources=11"])


def test_an_area_that_no_plan_can_name_enough_uavs_for_is_refused_and_a_spiral_searches_it_with_any() -> None:
    wide = ["nodes.count=45", "world.area_m=40000"]
    for search in ("lines", "sectors"):
        with pytest.raises(ConfigError, match=r"needs more than 200 UAVs .* a plan names at most 200"):
            catalog.find("rescue", [*wide, f"mission.search={search}"])
    assert catalog.find("rescue", [*wide, "mission.search=spiral"]).mission.search == "spiral"


def test_formation_flight_needs_clusters_and_uavs_that_fly_themselves() -> None:
    for override, wanted in (
        ("mobility.model=static", 'needs mobility.model = "onboard"'),
        ("mission.search=lines", 'needs mission.search = "none"'),
        ("routing.protocol=flooding", 'needs routing.protocol = "clustered"'),
        ("clusters.count=8", "needs clusters.count = 8 <= 7"),
        ("mission.formation_m=250", r"mission.formation_m = 250, .* must be < radio.range_m = 250"),
        ("mobility.speed_m_s=10", r"mobility.speed_m_s = 10, .* must be < mission.approach_speed_m_s = 10"),
    ):
        with pytest.raises(ConfigError, match=wanted):
            catalog.find("convoy", [override])


def test_a_route_beyond_the_geofence_is_refused() -> None:
    assert catalog.find("convoy", ["mission.route_m=[[0, -1550], [900, 700]]"]).mission.route_m[0] == (0, -1550)
    beyond = r"mission\.route_m\.1 = \[0, -1551\] must be within \[\+-1550, \+-1550\], the geofence"
    with pytest.raises(ConfigError, match=beyond):
        catalog.find("convoy", ["mission.route_m=[[0, 700], [0, -1551]]"])
    wide = ["nodes.spacing_m=1000", "radio.range_m=1500"]  # who starts beyond has the geofence behind it
    assert catalog.find("convoy", ["mission.route_m=[[1551, 0]]", *wide]).nodes.spacing_m == 1000


@pytest.mark.parametrize(
    ("key", "instead"),
    [
        ("clusters.relay=cds", r"clusters\.relay = 'cds': removed; take \"counter\" for fewer relays"),
        ("clusters.relay=claimed", r"clusters\.relay = 'claimed': removed; take routing\.protocol = \"rounds\""),
        ("mission.coverage_map=true", r"mission\.coverage_map: removed: as much was searched without it"),
        ("clusters.slots=8", r"clusters\.slots: removed .* take routing\.protocol = \"rounds\""),
    ],
)
def test_who_sets_what_was_removed_is_told_what_to_take_instead(key: str, instead: str) -> None:
    with pytest.raises(ConfigError, match=instead):
        catalog.find("clusters", [key])


@pytest.mark.parametrize(
    "text",
    [
        "0.5,200\n1.5,300\n",
        "seconds,bytes\n0.5,200\n1.5,300\n",
        "\n# by hand\nseconds,bytes\n0.5, 200\n1.5, 300",
        "+0.5,200\n1.5,300\n",
        "5E-01,200\n15e-1,3.0e2\n",
        "5.0e-1,200\r\n1.5,300\r\n",
        ".5,200\n1.5,300\n",
        '"0.5","200"\n"1.5","300"\n',
        "0,5;200\n1,5;300\n",
        "Zeit;Bytes\n0,5;200;\n1,5;300;\n",
        "0.5\t200\n1.5\t300\n",
        "sep=;\nZeit;Bytes\n0,5;200\n1,5;300\n",
        'seconds,bytes\n"0,5","200"\n"1,5","300"\n',
        "# by hand; for a try\n0.5,200\n  # a pause\n1.5,300\n",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_no_packet_of_a_spreadsheet_is_lost(tmp_path: Path, text: str, encoding: str) -> None:
    (tmp_path / "load.csv").write_bytes(text.encode(encoding))
    (tmp_path / "s.toml").write_text('[traffic]\narrivals = "trace"\npackets_csv = "load.csv"\n')
    assert config.load(tmp_path / "s.toml").traffic.packets == ((0.5, 200), (1.5, 300))


def test_a_heading_of_an_old_spreadsheet_is_in_latin_1_and_a_capture_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('[traffic]\narrivals = "trace"\npackets_csv = "load.csv"\n')
    (tmp_path / "load.csv").write_bytes("Zeit;Größe\r\n0,5;200\r\n".encode("latin-1"))
    assert config.load(tmp_path / "s.toml").traffic.packets == ((0.5, 200),)
    (tmp_path / "load.csv").write_bytes(b"\xd4\xc3\xb2\xa1\x02\x00\x04\x00")
    with pytest.raises(ConfigError, match=r"load\.csv: is no text in UTF-8"):
        config.load(tmp_path / "s.toml")
    (tmp_path / "load.csv").write_bytes(b"PK\x03\x04\x14\0\x06\0\x08\0[Content_Types].xml")
    with pytest.raises(ConfigError, match="it is a spreadsheet: save it as CSV"):
        config.load(tmp_path / "s.toml")


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("0.5,200\nx,300\n", "line 2: 'x,300'"),
        ("O.5,200\n1.5,300\n", "line 1: 'O.5,200'"),
        ("seconds,bytes\nseconds,bytes\n", "line 2"),
        ("0.5,200\n-1,300\n", "line 2: '-1,300' must be seconds,bytes: a number >= 0"),
        ("0.5,200.5\n", "line 1: '0.5,200.5'"),
        ("0.5,nan\n", "line 1: '0.5,nan'"),
        ("0,5,200\n", "line 1: '0,5,200'"),
        ("0.5,1_000\n", "line 1: '0.5,1_000'"),
        ("0.5," + "9" * 400, "line 1: '0.5,999"),
        ('"1,500","200"\n', 'line 1: \'"1,500","200"\''),
        ("0.5,200\n#N/A,300\n", "line 2: '#N/A,300'"),
        ("t [ms],bytes\n500,200\n", "'t [ms],bytes': the cells of each line must be seconds and bytes, in this order"),
        ("size;time\n1500;100\n", "line 1: 'size;time': the cells of each line must be seconds and bytes"),
        ("seconds,kB\n1,100\n", "line 1: 'seconds,kB': the cells"),
        ("seconds,bytes\n", "load.csv: holds no line seconds,bytes"),
        ("0.5,200\n1704067200.5,200\n", "line 2: '1704067200.5,200': seconds must be at most 1e+06"),
        ("0.5,200\n1.5,40\n", "line 2: '1.5,40': bytes must be within [64, 2304]"),
    ],
)
def test_a_line_of_a_packet_file_that_is_none_is_named(tmp_path: Path, text: str, wrong: str) -> None:
    (tmp_path / "load.csv").write_text(text)
    (tmp_path / "s.toml").write_text('[traffic]\narrivals = "trace"\npackets_csv = "load.csv"\n')
    with pytest.raises(ConfigError, match=re.escape(wrong)):
        config.load(tmp_path / "s.toml")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("my scénario v1.2.toml", "my-scenario-v1-2"),
        ("Übung.TOML", "Ubung"),
        ("日本.toml", "unnamed"),
        ("mine.txt", "mine"),
    ],
)
def test_a_scenario_file_may_have_a_byte_order_mark_and_any_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, name: str, encoding: str
) -> None:
    (tmp_path / file).write_bytes("duration_s = 7\n".encode(encoding))
    monkeypatch.chdir(tmp_path)
    found = catalog.find(file)
    assert (found.name, found.duration_s) == (name, 7)


def test_the_command_that_init_recommends_works_whatever_the_file_is_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert app(["init", "mine.txt", "--short"], result_action="return_value") == 0
    assert app(["check", "mine.txt"], result_action="return_value") == 0


@pytest.mark.parametrize("wrong", [0, -5, 1e9, math.nan, "sometimes"])
def test_a_connection_that_is_none_of_its_kinds_is_told_in_one_sentence(wrong: object) -> None:
    with pytest.raises(ConfigError, match=r"mission\.connection = .* must be always, none, or a number of seconds"):
        config.build({"mission": {"connection": wrong}})
    for right in ("always", "none", 20):
        assert config.build({"mission": {"connection": right}}).mission.connection == right


@pytest.mark.parametrize(
    ("keys", "repaired_s"),
    [
        ({"relay": "counter"}, 10),
        ({"relay": "counter", "repair_s": 0}, 0),
        ({"relay": "counter", "repair_s": 3}, 3),
        ({"relay": "all"}, 0),
        ({"relay": "scheduled"}, 0),
        ({"relay": "scheduled", "links": "measured"}, 10),
    ],
)
def test_packets_are_repaired_by_default_where_floods_lose_frames(keys: dict[str, object], repaired_s: int) -> None:
    assert config.build({"clusters": keys}).repair_ns == repaired_s * S
