"""Sweeps that are cut short and taken up again: the table is that of an uninterrupted one, and nothing runs twice."""

import errno
import json
import os
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.results import read
from sim.results.run_table import flat
from sim.sweep import spec
from sim.sweep.one_run import Finished, carry_out
from sim.sweep.provenance import code
from sim.sweep.store import TABLE, Store, write_whole
from sim.sweep.tasks import Task, tasks_of
from sim.sweep.whole_sweep import Progress, RemainingRuns, run

FILE = """
base = "flooding"
seeds = 2
measure = ["delay_counts", "wanted", "connected"]
set = {duration_s = 1.5, drain_s = 0.5, nodes.count = 4, traffic.interval_s = 0.2, world.engine = "kinematic"}
grid = {traffic.sources = [1, 2]}
"""


class OneByOne:
    """Carries runs out in this process, and dies before the run of the given number as a killed process would."""

    workers = 1

    def __init__(self, *, dies_after: int | None = None, backwards: bool = False) -> None:
        self.ran: list[str] = []
        self._dies_after = dies_after
        self._step = -1 if backwards else 1

    def carry_out(self, tasks: Sequence[Task]) -> Iterator[Finished]:
        for task in tasks[:: self._step]:
            if len(self.ran) == self._dies_after:
                raise KeyboardInterrupt
            self.ran.append(task.key)
            yield carry_out(task)


@pytest.fixture(scope="module")
def sweep() -> spec.Sweep:
    return spec.parse(FILE, source="test")


def go(
    folder: Path, sweep: spec.Sweep, workers: OneByOne, *, retry: bool = False, only_code: str | None = None
) -> list[Progress]:
    store, told = Store(folder), []
    with store.alone():
        store.read()
        plan = RemainingRuns(tasks_of(sweep), store, retry=retry, only_code=only_code)
        run(plan, store, workers, sweep.varied(), on_progress=told.append)
    return told


@pytest.fixture(scope="module")
def whole(sweep, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    go(folder, sweep, OneByOne())
    return folder


def test_a_sweep_that_is_ended_three_times_and_taken_up_again_is_byte_for_byte_an_uninterrupted_one(
    sweep, whole, tmp_path
) -> None:
    ran: list[str] = []
    for dies_after in (1, 0, 2, None):
        workers = OneByOne(dies_after=dies_after, backwards=dies_after == 2)
        try:
            go(tmp_path, sweep, workers)
        except KeyboardInterrupt:
            assert read(tmp_path).num_rows == len(ran) + len(workers.ran)
        ran += workers.ran
        (tmp_path / "finished" / ".000099.parquet.7.new").write_bytes(b"PAR1 half written")

    assert len(ran) == len(set(ran)) == 4
    assert (tmp_path / TABLE).read_bytes() == (whole / TABLE).read_bytes()


def test_what_is_half_written_is_removed_and_what_is_not_ours_is_left_alone(tmp_path) -> None:
    parts = tmp_path / "finished"
    parts.mkdir()
    left = {parts / "notes.txt", parts / "mine.parquet", tmp_path / ".mine.parquet.5.new"}
    for path in (*left, parts / ".000007.parquet.123.new", tmp_path / ".runs.parquet.123.new"):
        path.write_bytes(b"PAR1 half written")
    Store(tmp_path).read()
    assert {path for path in tmp_path.rglob("*") if path.is_file()} == left


def test_progress_counts_what_was_finished_before(sweep, tmp_path) -> None:
    with pytest.raises(KeyboardInterrupt):
        go(tmp_path, sweep, OneByOne(dies_after=3))
    told = go(tmp_path, sweep, OneByOne())
    assert [(at.done, at.total) for at in told] == [(3, 4), (4, 4)]
    assert [at.left_s for at in told] == [None, 0], "it is not known how fast runs are until one has ended"


def test_a_row_has_settings_figures_and_the_command_that_gives_the_same_figures(sweep, whole) -> None:
    row = read(whole).to_pylist()[-1]
    assert (row["traffic.sources"], row["seed"], row["status"], row["valid"]) == (2, 2, "ok", True)
    assert row["command"].startswith("fanet simulate flooding --set duration_s=1.5 --set drain_s=0.5")
    summary = json.loads(row["summary"])
    assert "wall_s" not in summary
    assert {name: row[name] for name in ("pdr", "delay_ms.p95", "copies.on_air")} == {
        name: flat(summary)[name] for name in ("pdr", "delay_ms.p95", "copies.on_air")
    }
    assert row["wanted"] == row["generated"] * 3
    assert sum(row["delay_counts"]) == row["delivered"] > 0
    assert row["connected"] == 1


def test_settings_that_share_a_seed_draw_the_same_births(sweep, whole) -> None:
    """Common random numbers: the births of a source do not depend on how many others there are."""
    tasks = {(task.value("traffic.sources"), task.seed): task for task in tasks_of(sweep)}
    from fanet_mw.scenario import config
    from sim.run.virtual import simulate

    def births(sources: int) -> dict[int, list[int]]:
        found: dict[int, list[int]] = {}
        for record in simulate(config.build(tasks[sources, 1].tree)).records:
            if type(record).__name__ == "Generated":
                found.setdefault(record.node, []).append(record.t_ns)
        return found

    one, two = births(1), births(2)
    shared = set(one) & set(two)
    assert shared
    assert all(one[node] == two[node] for node in shared)


def test_a_run_that_fails_is_a_row_with_its_error_and_is_repeated_only_when_asked(sweep, tmp_path, monkeypatch) -> None:
    from sim.sweep import one_run

    def broken(_: object) -> None:
        raise RuntimeError("the medium is on fire")

    with monkeypatch.context() as patched:
        patched.setattr(one_run, "simulate", broken)
        told = go(tmp_path, sweep, OneByOne())
    assert told[-1].failed == 4
    row = read(tmp_path).to_pylist()[0]
    assert row["status"] == "failed"
    assert row["error"].startswith("RuntimeError: the medium is on fire\n")
    assert "in broken" in row["error"]
    assert row["command"].startswith("fanet simulate flooding")

    assert go(tmp_path, sweep, OneByOne())[-1].failed == 4
    assert go(tmp_path, sweep, OneByOne(), retry=True)[-1].failed == 0
    assert set(read(tmp_path).column("status").to_pylist()) == {"ok"}


def test_exactly_the_runs_of_other_code_are_run_again_when_that_is_asked_for(whole, sweep, tmp_path) -> None:
    shutil.copytree(whole, tmp_path / "mixed")
    store = Store(tmp_path / "mixed")
    store.read()
    older = [task.key for task in tasks_of(sweep)][1:3]
    for key in older:
        store.add(replace(found(store, key), code="0.0.9+0ld"))
    assert RemainingRuns(tasks_of(sweep), store).codes == {"0.0.9+0ld": 2, code(): 2}
    kept, again = OneByOne(), OneByOne()
    go(tmp_path / "mixed", sweep, kept)
    assert kept.ran == []
    assert read(tmp_path / "mixed").column("code").to_pylist() == [code(), "0.0.9+0ld", "0.0.9+0ld", code()]
    go(tmp_path / "mixed", sweep, again, only_code=code())
    assert sorted(again.ran) == sorted(older)
    assert (tmp_path / "mixed" / TABLE).read_bytes() == (whole / TABLE).read_bytes()


def found(store: Store, key: str) -> Finished:
    done = store.get(key)
    assert done is not None
    return done


def test_a_sweep_that_has_grown_runs_only_what_is_new(sweep, whole, tmp_path) -> None:
    shutil.copytree(whole, tmp_path / "grown")
    workers = OneByOne()
    go(tmp_path / "grown", sweep.model_copy(update={"seeds": 3}), workers)
    assert len(workers.ran) == 2
    assert read(tmp_path / "grown").num_rows == 6


def test_two_sweeps_do_not_write_to_one_folder(sweep, tmp_path) -> None:
    with (
        Store(tmp_path).alone(),
        pytest.raises(ConfigError, match="another sweep writes there"),
        Store(tmp_path).alone(),
    ):
        pass


def test_files_of_single_runs_are_made_one_before_they_are_many(sweep, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("sim.sweep.store._MERGE_AT", 3)
    go(tmp_path, sweep, OneByOne())
    assert len(list((tmp_path / "finished").glob("*.parquet"))) == 2
    workers = OneByOne()
    go(tmp_path, sweep, workers)
    assert workers.ran == []


def test_what_is_finished_after_a_merge_leaves_the_file_with_all_others_alone(sweep, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("sim.sweep.store._MERGE_AT", 2)
    with pytest.raises(KeyboardInterrupt):
        go(tmp_path, sweep, OneByOne(dies_after=2))
    assert len(list((tmp_path / "finished").glob("*.parquet"))) == 1
    monkeypatch.setattr("sim.sweep.store._MERGE_AT", 9)
    go(tmp_path, sweep, OneByOne())
    workers = OneByOne()
    go(tmp_path, sweep, workers)
    assert workers.ran == []


def test_a_folder_without_results_is_an_error(tmp_path) -> None:
    with pytest.raises(ConfigError, match=r"holds neither runs\.parquet"):
        read(tmp_path)


def test_who_may_read_a_table_is_what_the_umask_says(tmp_path: Path) -> None:
    before = os.umask(0o022)
    try:
        write_whole(tmp_path / "runs.parquet", pa.table({"seed": [1]}))
    finally:
        os.umask(before)
    (table,) = tmp_path.iterdir()
    assert table.stat().st_mode & 0o777 == 0o644


def test_a_folder_that_leads_elsewhere_or_holds_no_results_of_runs_is_refused(tmp_path: Path) -> None:
    elsewhere, out = tmp_path / "elsewhere", tmp_path / "out"
    for folder in (elsewhere, out):
        folder.mkdir()
    (elsewhere / ".000001.parquet.1.new").touch()
    (out / "finished").symlink_to(elsewhere)
    with pytest.raises(ConfigError, match="finished is no folder of its own"):
        Store(out).read()
    assert (elsewhere / ".000001.parquet.1.new").exists()
    (out / "finished").unlink()
    (out / ".lock").symlink_to(elsewhere / "made")
    with pytest.raises(ConfigError), Store(out).alone():
        pytest.fail("locked")
    assert not (elsewhere / "made").exists()
    (out / "finished").mkdir()
    row = {"key": "a", "code": "b", "wall_s": 1.0, "cpu_s": 1.0, "measured": "{}", "summary": None, "error": None}
    for wrong in ({"summary": "[1]"}, {"summary": "{"}, {"measured": "NaN"}, {"code": None}, {"wall_s": None}, {}):
        pq.write_table(pa.Table.from_pylist([{**row, **wrong}]), out / "finished" / "000001.parquet")
        with pytest.raises(ConfigError, match=r"000001\.parquet"):
            Store(out).read()
    (out / "finished" / "000001.parquet").write_bytes(b"PAR1")
    with pytest.raises(
        ConfigError, match=r"000001\.parquet: cannot be read: .*; remove it, and its runs are repeated$"
    ):
        Store(out).read()


def test_a_file_system_that_cannot_lock_is_one_sentence_and_nothing_of_it_stays_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_locks(*_: object) -> None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    monkeypatch.setattr("fcntl.flock", no_locks)
    opened = len(list(Path("/proc/self/fd").iterdir()))
    with pytest.raises(ConfigError, match="its file system cannot lock files"), Store(tmp_path).alone():
        pass
    assert len(list(Path("/proc/self/fd").iterdir())) == opened


def test_an_error_in_a_sweep_is_not_taken_for_one_of_its_lock(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="disk"), Store(tmp_path).alone():
        raise OSError(errno.ENOSPC, "disk")


def test_what_no_text_can_hold_stands_in_the_table_by_its_code(sweep, whole, tmp_path: Path) -> None:
    """The name of a file may be any bytes, of which Python makes halves of pairs of surrogates."""
    store = Store(shutil.copytree(whole, tmp_path / "store"))
    store.read()
    task = tasks_of(sweep)[0]
    done = store.get(task.key)
    assert done is not None
    summary = json.dumps({**json.loads(done.summary or ""), "odd": "\udcff", "list": ["\ud800"]})
    store.add(replace(done, summary=summary, error="b\udcff.toml: é"))
    table = store.publish([replace(task, case="b\udcff")], sweep.varied())
    assert [table[name][0].as_py() for name in ("case", "error", "odd")] == ["b\\udcff", "b\\udcff.toml: é", "\\udcff"]


def test_a_file_of_another_program_among_finished_runs_may_be_removed(whole, tmp_path: Path) -> None:
    store = Store(shutil.copytree(whole, tmp_path / "store"))
    pq.write_table(pa.table({"a": [1]}), store.folder / "finished" / "000009.parquet")
    with pytest.raises(ConfigError, match=r"000009.parquet: key: .*: remove it, and its runs are repeated"):
        store.read()
