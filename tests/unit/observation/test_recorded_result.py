"""The recording that is made of a run that is over holds all nodes from the beginning, the post and those at rest."""

import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
from kit import MakeScenario
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from fanet_mw.errors import BusError
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Posed, Record, RoleChanged
from fanet_mw.units import S
from sim.observation.timeline import Timeline
from sim.recording.from_result import record, write_mcap
from sim.recording.mcap_recording import McapRecording
from sim.recording.tracks import write_kml
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.virtual import EPOCH_UNIX_NS, simulate
from sim.world.environment.obstacles import terrain


def written(path: Path, scenario: Scenario, *records: Record) -> list[tuple[str, int, Any]]:
    """Topic, instant [s] and message of all that is written of a trace."""
    outcome = Outcome(scenario=scenario, mode="virtual", wall_s=1.0, records=list(records), reports={})
    write_mcap(outcome, path)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, message.log_time // S, decoded)
            for _, channel, message, decoded in reader.iter_decoded_messages()
        ]


def test_a_swarm_that_stands_still_has_its_places_and_figures_each_second(
    make_scenario: MakeScenario, tmp_path: Path
) -> None:
    scenario = make_scenario(**{"nodes.count": 2, "nodes.spacing_m": 100, "nodes.altitude_m": 30, "duration_s": 5})
    found = written(tmp_path / "a.mcap", scenario, RoleChanged(S, 2, "head", 0, 2))
    assert [t_s for topic, t_s, _ in found if topic == "/metrics"] == [0, 1, 2, 3, 4, 5]
    places = {(one.east_m, one.up_m) for topic, _, one in found if topic == "/uav/2/state"}
    assert places == {(50.0, 30.0)}


def test_the_post_is_at_its_place_while_the_uavs_fly(make_scenario: MakeScenario, tmp_path: Path) -> None:
    post = {"ground.at_m": [-70, 20], "ground.antenna_m": 2}
    scenario = make_scenario(**{"nodes.count": 1, "mobility.model": "formation", "duration_s": 5, **post})
    flown = [Posed(second * S, 1, 10.0 * second, 0.0, 30.0) for second in range(4)]
    found = written(tmp_path / "a.mcap", scenario, *flown, RoleChanged(3 * S + 1, 2, "head", 0, 2))
    poses = [[pose.position.x for pose in one.poses] for topic, t_s, one in found if topic == "/poses"]
    assert poses[:4] == [[0.0, -70.0], [10.0, -70.0], [20.0, -70.0], [30.0, -70.0]]
    places = {(one.east_m, one.north_m, one.up_m) for topic, _, one in found if topic == "/uav/2/state"}
    assert places == {(-70.0, 20.0, 2.0)}


def test_who_records_a_swarm_whose_router_goes_before_its_time_begins_is_told_so(tmp_path: Path) -> None:
    def gone() -> None:
        raise BusError("the Zenoh router is gone")

    looks = iter(range(100))
    feed = SimpleNamespace(listen=lambda: None, clock=None, look=lambda: next(looks), bus=SimpleNamespace(check=gone))
    with pytest.raises(BusError, match="gone"):
        record(feed, tmp_path / "a.mcap")  # type: ignore[arg-type]


def test_heights_on_a_map_are_those_above_the_ground_below(make_scenario: MakeScenario, tmp_path: Path) -> None:
    scenario = make_scenario(**{"nodes.count": 1, "world.terrain_m": 60, "mobility.model": "formation"})
    hills = terrain(scenario)
    assert hills is not None
    east_m, north_m = max(
        ((x, y) for x in range(-200, 201, 50) for y in (-100, 100)), key=lambda at: hills.height_m(*at)
    )
    up_m = hills.height_m(east_m, north_m) + 40.0
    flown = [Posed(second * S, 1, east_m, north_m, up_m) for second in range(2)]
    outcome = Outcome(scenario=scenario, mode="virtual", wall_s=1.0, records=flown, reports={})
    write_kml(outcome, tmp_path / "a.kml")
    places = ElementTree.parse(tmp_path / "a.kml").iter("{http://www.google.com/kml/ext/2.2}coord")
    assert up_m > 45.0
    assert [str(place.text).split()[2] for place in places] == ["40.00", "40.00"]


def test_what_two_recordings_in_a_folder_tell_is_told_once_and_in_order(
    make_scenario: MakeScenario, tmp_path: Path
) -> None:
    quiet = {"traffic.arrivals": "none", "duration_s": 3, "drain_s": 0.5, "warmup_s": 0}
    scenario = make_scenario(**quiet, **{"nodes.count": 2, "nodes.spacing_m": 50, "nodes.telemetry_hz": 0})
    with McapRecording(tmp_path / "a.mcap", scenario, epoch_unix_ns=EPOCH_UNIX_NS) as recording:
        outcome = simulate(scenario, observer=recording)
    finish(outcome, out=tmp_path / "run")
    shown = []
    for name in ("a.mcap", "b.mcap"):
        shutil.copy(tmp_path / "a.mcap", tmp_path / "run" / name)
        state = Timeline(tmp_path / "run").at(3 * S)
        shown.append(sorted(state.link_rows()))
    assert shown[0] == shown[1]
    assert shown[0]
