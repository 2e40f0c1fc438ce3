"""A finished run as the view plays it again."""

from pathlib import Path

from fanet_mw.scenario import config
from fanet_mw.units import S
from sim.observation.timeline import Timeline
from sim.results.files import finish
from sim.run.virtual import simulate


def test_a_run_in_which_nothing_was_recorded_is_played_to_its_end(tmp_path: Path) -> None:
    quiet = {"traffic": {"arrivals": "none"}, "routing": {"protocol": "flooding"}, "nodes": {"count": 2}}
    outcome = simulate(config.build({"duration_s": 1, "drain_s": 0.5, **quiet}))
    assert not outcome.records
    finish(outcome, out=tmp_path / "run")
    timeline = Timeline(tmp_path / "run")
    assert timeline.end_ns == 1 * S
    assert sorted(timeline.at(S // 2).uavs) == [1, 2]
