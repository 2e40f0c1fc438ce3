"""A finished run as the view plays it again."""

from pathlib import Path

from fanet_mw.scenario import config
from fanet_mw.units import S
from sim.inspection.inspection import of_folder
from sim.observation.timeline import Timeline
from sim.results.files import finish
from sim.results.run_folder import RunFolder
from sim.run.virtual import simulate


def test_a_run_in_which_nothing_was_recorded_is_played_to_its_end(tmp_path: Path) -> None:
    quiet = {"traffic": {"arrivals": "none"}, "routing": {"protocol": "flooding"}, "nodes": {"count": 2}}
    outcome = simulate(config.build({"duration_s": 1, "drain_s": 0.5, **quiet}))
    assert not outcome.records
    finish(outcome, out=tmp_path / "run")
    timeline = Timeline(tmp_path / "run")
    assert timeline.end_ns == 1 * S
    assert sorted(timeline.at(S // 2).uavs) == [1, 2]


def test_what_a_system_says_that_stands_for_two_nodes_is_told_of_neither(tmp_path: Path) -> None:
    """Node 1 had the battery of node 251, whose MAVLink has the same system id."""
    quiet = {"traffic": {"arrivals": "none"}, "routing": {"protocol": "flooding", "hello_interval_s": 0}}
    nodes = {"count": 251, "layout": "explicit", "positions_m": [[5.0 * node, 0.0, 50.0] for node in range(251)]}
    keys = {"duration_s": 1.5, "drain_s": 0.5, "nodes": nodes, "world": {"area_m": 3000}}
    outcome = simulate(config.build({**keys, **quiet}))
    finish(outcome, out=tmp_path / "run")
    said = {key.node for key in of_folder(RunFolder(tmp_path / "run")).messages.streams}
    assert said == {0, *range(2, 251)}
    state = Timeline(tmp_path / "run").at(1 * S)
    assert [node for node, uav in state.uavs.items() if not uav.said] == [1, 251]
