"""What the flags of `fanet sweep` mean, typed as a user types them."""

import json
import re
from pathlib import Path

import pytest

from sim.cli.app import app, changes_last
from sim.cli.sweep import carry_out
from sim.sweep.one_run import processor_s
from sim.sweep.spec import Sweep


@pytest.mark.parametrize(
    "line",
    [
        "sweep quick --set nodes.count=5,6,7 --set traffic.interval_s=1,2 --seeds 4",
        "sweep quick --set nodes.count=5,6,7 traffic.interval_s=1,2 --seeds 4",
        "sweep --set nodes.count=5,6,7 --seeds 4 --set traffic.interval_s=1,2 quick",
    ],
)
def test_keys_are_set_one_by_one_or_together_before_or_behind_the_name(
    line: str, tmp_path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [*line.split(), "--dry-run", "--jobs", "1", "--out", str(tmp_path)]
    assert app(changes_last(words), result_action="return_value") == 0
    assert "24 runs (6 settings x 4 seeds)" in capsys.readouterr().err


def test_a_dry_run_leaves_nothing_behind(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:
    assert carry_out("short", Sweep(base="quick"), out=tmp_path / "short", jobs=1, scheduler=None, dry_run=True) == 0
    assert "1 run (1 setting x 1 seed); 1 process" in capsys.readouterr().err
    assert [*tmp_path.iterdir()] == []


def test_a_dry_run_prints_as_json_what_it_would_run(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "sweep",
        "quick",
        "--set",
        "nodes.count=5,6",
        "--seeds",
        "2",
        "--dry-run",
        "--json",
        "--jobs",
        "1",
        "--out",
    ]
    assert app([*words, str(tmp_path)], result_action="return_value") == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["table"], answer["finished"]) == (str(tmp_path / "runs.parquet"), 0)
    assert [(run["seed"], run["command"]) for run in answer["to_run"]] == [
        (seed, f"fanet simulate quick --set nodes.count={count} --seed {seed}") for count in (5, 6) for seed in (1, 2)
    ]


@pytest.mark.slow
def test_the_cpu_that_a_sweep_took_is_that_of_its_workers_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = {"duration_s": 1.5, "drain_s": 0.5, "nodes.count": 2, "traffic.sources": 1, "world.engine": "kinematic"}
    before_s = processor_s()
    assert carry_out("short", Sweep(base="flooding", set=settings), out=tmp_path / "short", jobs=1, scheduler=None) == 0
    taken_s = processor_s() - before_s
    said = re.search(r"\((\d+) s of CPU\)", capsys.readouterr().out)
    assert said is not None
    assert taken_s - 0.7 < int(said[1]) <= taken_s + 0.5, "the start of a worker takes longer than so short a run"
