"""What a scenario says that will have no effect is said to its author, and in the summary."""

import json
from pathlib import Path

import pytest

from fanet_mw.scenario import config
from sim.cli.app import app
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog
from sim.scenarios.notes import notes

SHORT = {
    "duration_s": 5, "drain_s": 1, "nodes": {"count": 2, "layout": "line"}, "routing": {"protocol": "flooding"},
    "traffic": {"arrivals": "none"},
}  # fmt: skip


TOWN = """duration_s = 1
[nodes]
count = 2
layout = "line"
[routing]
protocol = "flooding"
[traffic]
arrivals = "none"
[world]
buildings_geojson = "town.geojson"
origin_deg = [48.85, 2.35]
"""
CUTS = [{"kind": "cut", "node": 1, "at_s": 5}, {"kind": "cut", "node": 1, "at_s": 4}]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, []),
        (
            {"faults": [{"kind": "cut", "node": 1, "at_s": 5}, {"kind": "cut", "node": 1, "at_s": 4}]},
            ["faults.0.at_s = 5"],
        ),
        (
            {"radio": {"channel": "range", "range_m": 90}, "nodes": {"count": 3, "layout": "line", "spacing_m": 100}},
            ["radio.range_m = 90: 3 of 3 nodes hear nobody where they start"],
        ),
        ({"radio": {"channel": "range", "range_m": 100}, "nodes": {"count": 3, "layout": "line", "spacing_m": 90}}, []),
        ({"clock": {"jumps": [[1, 4.9, 1], [2, 50, 300]]}}, ["clock.jumps.1.1 = 50"]),
        ({"traffic": {"start_s": 4}}, ["traffic: start_s = 4, after the last packet, duration_s - drain_s = 4"]),
        (
            {"traffic": {"arrivals": "trace", "packets": [[1, 99], [4, 99], [9, 99]]}},
            ["traffic: 2 of 3 packets come too late to be sent, from 4 s on; duration_s - drain_s = 4"],
        ),
    ],
)
def test_what_comes_after_the_end_is_noted(changes: dict[str, object], said: list[str]) -> None:
    found = notes(config.build({**SHORT, **changes}))
    assert [text.partition(": after the end")[0] for text in found] == said


CUT, GPS = 'kind="cut",node=2,at_s=1', 'kind="gps",node=2,at_s=2,for_s=1'
JAMS = 'kind="jam",radius_m=9,at_s=1,center_m=[0,0]', 'kind="jam",radius_m=9,at_s=1,center_m=[50,0]'
DEGRADES = 'kind="degrade",src=1,dst=2,at_s=1,loss_db=3', 'kind="degrade",src=1,dst=2,at_s=2,loss_db=9'


@pytest.mark.parametrize(
    ("faults", "said"),
    [
        ((CUT, GPS), "faults.1 ends faults.0 at 2 s: both have the label node-2; give one of them a label of its own"),
        ((GPS, CUT), "faults.0 ends faults.1 at 2 s: both have the label node-2; give one of them a label of its own"),
        ((f"{CUT.replace('cut', 'stop')},for_s=5", GPS), None),
        ((f"{CUT},for_s=1", GPS), None),
        (
            (f"{CUT},for_s=2", GPS.replace("for_s=1", "for_s=5")),
            "faults.1 ends faults.0 at 2 s: both have the label node",
        ),
        ((CUT, f'{GPS},label="receiver"'), None),
        ((f'{CUT},label="x"', f'{GPS},label="x"'), None),
        (JAMS, "faults.1 ends faults.0 at 1 s: both have the label jam; give one of them a label of its own"),
        (DEGRADES, None),
        (
            (DEGRADES[0], f"{DEGRADES[1]},for_s=1"),
            "faults.1 ends faults.0 at 2 s: both have the label link-1-2; give one of them a label of its own",
        ),
        ((f"{CUT},for_s=3", f"{CUT},for_s=1"), "faults.1 ends faults.0 at 1 s: both have the label node-2; give one o"),
        ((CUT, 'kind="restore",at_s=2'), None),
        ((CUT, 'kind="restore",at_s=2,label="node-2"', GPS), None),
        ((CUT, 'kind="restore",at_s=2', GPS), None),
        (
            (CUT, 'kind="restore",at_s=2,label="cut 2"'),
            "faults.1.label = 'cut 2': ends no fault, whose labels are node-2",
        ),
        (('kind="restore",at_s=2,label="jam"', JAMS[0].replace("at_s=1", "at_s=3")), "faults.0.label = 'jam': ends no"),
        (('kind="crash",node=2,at_s=1,for_s=2',), "faults.0.for_s = 2: no effect; a crash is for good"),
        (('kind="crash",node=2,at_s=1', CUT), None),
    ],
)
def test_faults_that_end_others_unasked_or_end_none_are_noted(faults: tuple[str, ...], said: str | None) -> None:
    """The second of two jammers ended the first, and a receiver that failed switched a radio on again."""
    every = ",".join(f"{{{fault}}}" for fault in faults)
    found = notes(catalog.find("quick", [f"faults=[{every}]"]))
    assert [note[: len(said or "")] for note in found] == ([said] if said else [])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (["radio.channel=friis"], None),
        (
            ["radio.channel=friis", "radio.sensitivity_dbm=82"],
            "radio.channel = 'friis' reaches 1 m: 45 of 45 nodes",
        ),
        (
            ["radio.channel=log_distance", "radio.exponent=4"],
            "radio.channel = 'log_distance' reaches 62.9 m: 45 of 45 n",
        ),
        (["radio.channel=log_distance", "radio.exponent=4", "radio.shadowing_db=12"], None),
        (["mobility.model=random_waypoint", "world.area_m=2.5"], "world.area_m = 2.5: 44 of 45 nodes start outside"),
        (["mobility.model=random_waypoint", "world.area_m=2.5km"], None),
        (["mobility.model=random_waypoint", "world.area_m=900", "world.base_m=[1500, 0]"], None),
        (["world.area_m=2.5"], None),
    ],
)
def test_a_swarm_that_hears_nobody_or_starts_outside_its_area_is_noted(changes: list[str], said: str | None) -> None:
    """A sign or a unit that is forgotten is a run of nobody, or over the area of a table."""
    found = notes(catalog.find("flooding", changes))
    assert [note[: len(said or "")] for note in found] == ([said] if said else [])


def test_a_formation_that_is_longer_than_packets_may_go_is_noted() -> None:
    large = ["nodes.count=200", "world.area_m=5000"]
    (said,) = notes(catalog.find("rescue", large))
    assert said.startswith("routing.hop_limit = 32: the formation of 200 UAVs is up to 52 hops long")
    assert not notes(catalog.find("rescue", [*large, "routing.hop_limit=52"]))
    assert not notes(catalog.find("rescue"))


def test_uavs_for_whom_the_plan_has_no_place_are_noted() -> None:
    few = ["world.area_m=1000", "nodes.spacing_m=50"]
    assert notes(catalog.find("rescue", [*few, "nodes.count=200"])) == []
    (said,) = notes(catalog.find("rescue", [*few, "nodes.count=203"]))
    assert said.startswith("nodes.count = 203: the plan of a search has 200 places; 3 of the UAVs will get none")


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (("nodes.spacing_m=4.8", "sensors.pad_hz=0"), True),
        (("nodes.spacing_m=4.8",), False),
        (("nodes.spacing_m=5", "sensors.pad_hz=0"), False),
        (("nodes.spacing_m=3.2", "sensors.pad_hz=0", "sensors.gps_bias_m=0.02", "world.gps_sigma_m=0.02"), False),
        (("nodes.spacing_m=4.8", "sensors.pad_hz=0", "nodes.on_ground=false"), False),
    ],
)
def test_pads_that_receivers_confuse_are_noted(changes: tuple[str, ...], *, told: bool) -> None:
    found = [note for note in notes(catalog.find("rescue-base", changes)) if note.startswith("nodes.spacing_m")]
    assert len(found) == told


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (["nodes.altitude_m=77"], []),
        (["nodes.altitude_m=85"], ["over nodes.altitude_m = 85 that needs 128 m"]),
        (["nodes.altitude_m=85", "mission.ceiling_m=128"], []),
        (["mobility.return_step_m=5"], []),
        (
            ["mobility.return_step_m=5", "mobility.return_after_s=9"],
            ["UAV 16 returns at 175 m, above mission.ceiling_m"],
        ),
        (["mobility.return_step_m=1", "mobility.geofence=return"], []),
    ],
)
def test_heights_that_a_ceiling_has_no_room_for_are_noted(changes: list[str], said: list[str]) -> None:
    found = notes(catalog.find("rescue", ["nodes.count=16", "traffic.sources=15", *changes]))
    assert [any(part in note for part in said) for note in found] == [True] * len(said)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (["world.buildings=9", "world.building_height_m=[20, 66]", "sensors.map_share=0.9"], ["up to 66 m high"]),
        (["world.buildings=9", "world.building_height_m=[20, 65]", "sensors.map_share=0.9"], []),
        (["world.buildings=[[0, 300, 9, 9, 80]]", "mission.search=none"], ["up to 80 m high", "search = 'none'"]),
        (["world.buildings=[[0, 300, 9, 9, 80]]"], []),
        (["world.buildings=[[0, 300, 9, 9, 80]]", "sensors.map_share=0", "radio.obstruction_loss_db=0"], []),
        (["world.buildings=[[0, 300, 9, 9, 80]]", "sensors.map_share=0", "radio.channel=air_to_air"], []),
        (["world.charge=[0.1, 0.15]", "sensors.battery_hz=1"], ["at most 0.15, not more than mission.reserve_charge"]),
        (["world.charge=[0.1, 0.2]", "sensors.battery_hz=1"], []),
        (["world.charge=[0.1, 0.1]"], []),
    ],
)
def test_what_a_search_cannot_cope_with_is_noted(changes: list[str], said: list[str]) -> None:
    found = notes(catalog.find("rescue", changes))
    assert [any(part in note for part in said) for note in found] == [True] * len(said)


def test_places_of_a_formation_beyond_the_geofence_are_noted() -> None:
    assert notes(catalog.find("convoy")) == []
    (said,) = notes(catalog.find("convoy", ["mission.route_m=[[0, 700], [920, 700]]"]))
    assert said.startswith("mission.route_m.1 = [920, 700]: places of the formation are up to 640 m from the leader")
    (alone,) = notes(catalog.find("convoy", ["mission.route_m=[[0, -1351]]", "clusters.count=1"]))
    assert "up to 200 m from the leader" in alone


def test_who_flies_by_the_papers_rule_alone_is_said_to_keep_clear_of_nobody() -> None:
    alone = ["mission.search=none"]
    (said,) = notes(catalog.find("rescue", alone))
    assert said.startswith("mission.search = 'none': UAVs stay where they start until they fly to a survivor")
    for changes in (
        ["mission.collision_horizon_s=8", "mission.collision_distance_m=4"], ["mobility.model=random_waypoint"],
        ["mission.survivors=0"],
    ):  # fmt: skip
        assert notes(catalog.find("rescue", [*alone, *changes])) == []


def test_an_order_after_the_end_is_noted() -> None:
    orders = 'orders=[{order="end", at_s=70}, {order="end", at_s=9}]'
    found = notes(catalog.find("rescue", ["duration_s=40", "ground.at_m=[0, 0]", orders]))
    assert found == ["orders.0.at_s = 70: after the end, duration_s = 40"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            ["routing.protocol=aodv", "clusters.relay=scheduled"],
            "clusters.relay: no effect with routing.protocol = 'aodv'",
        ),
        (["rounds.bulk_share=0.4"], "rounds.bulk_share: no effect with routing.protocol = 'flooding'"),
        (["nodes.layout=line", "nodes.radius_m=5"], "nodes.radius_m: no effect with nodes.layout = 'line'"),
        (["routing.gossip_p=0.3"], "routing.gossip_p: no effect with routing.protocol = 'flooding'"),
        (["radio.exponent=4"], "radio.exponent: no effect with radio.channel = 'range'"),
        (["radio.frequency_mhz=5200"], "radio.frequency_mhz: no effect with radio.channel = 'range'"),
        (
            ["radio.tx_power_dbm=20", "radio.noise_figure_db=5"],
            "radio.tx_power_dbm, radio.noise_figure_db: no effect with radio.channel = 'range'",
        ),
        (["radio.capture_db=4"], "radio.capture_db: no effect with radio.capture = False"),
        (["clock.limit_s=3"], "clock.limit_s: no effect with clock.sync = 'none'"),
        (["mission.formation_m=30"], "mission.formation_m: no effect with mission.formation = 'none'"),
        (["radio.channel=friis", "radio.frequency_mhz=2437", "radio.tx_power_dbm=20"], None),
        (["radio.channel=log_distance", "radio.exponent=2.5"], None),
        (["routing.protocol=gossip", "routing.gossip_p=0.3"], None),
    ],
)
def test_a_key_that_has_no_effect_under_what_was_chosen_is_noted(changes: list[str], said: str | None) -> None:
    assert notes(catalog.find("flooding", changes)) == ([said] if said else [])


def test_no_shipped_scenario_sets_what_has_no_effect() -> None:
    assert {entry.name: found for entry in catalog.shipped() if (found := notes(catalog.find(entry.name)))} == {}


def test_a_guessed_height_is_noted_before_the_run_and_in_its_summary(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ring = [[2.3538, 48.8564], [2.3542, 48.8564], [2.3542, 48.8568], [2.3538, 48.8564]]
    house = {
        "type": "Feature", "properties": {"@id": "way/7", "height": "tall"},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }  # fmt: skip
    (tmp_path / "town.geojson").write_text(json.dumps(house))
    (tmp_path / "s.toml").write_text(TOWN)
    app(["check", str(tmp_path / "s.toml")], result_action="return_value")
    said = "1 building of a height that was guessed: way/7: height = tall: taken as 19 m"
    assert said in capsys.readouterr().err
    summary = finish(simulate(config.load(tmp_path / "s.toml")), out=None)
    assert summary["notes"] == [f"world.buildings_geojson: {said}"]


def test_buildings_without_a_height_are_counted(tmp_path: Path) -> None:
    ring = [[2.3538, 48.8564], [2.3542, 48.8564], [2.3542, 48.8568], [2.3538, 48.8564]]
    houses = [
        {"type": "Feature", "properties": tags, "geometry": {"type": "Polygon", "coordinates": [ring]}}
        for tags in ({"building": "yes"}, {"height": " "}, {"height": "9"}, {"building:levels": "3"})
    ]
    (tmp_path / "town.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": houses}))
    (tmp_path / "s.toml").write_text(TOWN)
    said = "world.buildings_geojson: 2 buildings state no height: taken as 19 m"
    assert notes(config.load(tmp_path / "s.toml")) == [said]


@pytest.mark.parametrize(
    ("changes", "told"),
    [((), True), (("radio.scatterer_speed_m_s=1",), False), (("mobility.model=random_waypoint",), False)],
)
def test_links_that_keep_one_gain_are_told(changes: tuple[str, ...], *, told: bool) -> None:
    fading = ("radio.channel=friis", "radio.fading=rician")
    found = [note for note in notes(catalog.find("flooding", [*fading, *changes])) if note.startswith("radio.fading")]
    assert len(found) == told


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (["world.engine=rotors", "mobility.speed_m_s=30"], "iris flies at most 19 m/s through the air, and needs 30"),
        (["world.engine=rotors", "mobility.speed_m_s=7.5", "world.wind_m_s=[0, 14]"], "needs 21.5 against the wind"),
        (["radio.channel=friis", "radio.frequency_mhz=5180"], "IEEE 802.11b is sent at 2.4 GHz"),
        (["radio.channel=friis", "radio.standard=a", "radio.frequency_mhz=2412"], "IEEE 802.11a is sent at 5 GHz"),
    ],
)
def test_what_no_vehicle_and_no_radio_does_is_said(keys: list[str], said: str) -> None:
    assert any(said in note for note in notes(catalog.find("crossing", keys)))
    assert not any("at most" in note or "is sent at" in note for note in notes(catalog.find("crossing")))
