"""The recorded events of a run, read back by a program of a user."""

from pathlib import Path

import pytest

from fanet_mw.errors import ConfigError
from fanet_mw.results import records
from fanet_mw.trace import Delivered, Generated
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("run") / "result"
    finish(simulate(catalog.find("quick", ["duration_s=6", "warmup_s=1", "drain_s=1"])), out=made)
    return made


def test_all_records_come_back_in_the_order_of_the_file(folder: Path) -> None:
    lines = (folder / "trace.jsonl").read_text(encoding="utf-8").splitlines()
    found = list(records(folder))
    assert len(found) == len(lines) > 100
    assert [str(record.t_ns) in line for record, line in zip(found, lines, strict=True)] == [True] * len(lines)


def test_with_kinds_only_those_come_in_the_same_order(folder: Path) -> None:
    wanted = [record for record in records(folder) if isinstance(record, Delivered | Generated)]
    assert list(records(str(folder), Delivered, Generated)) == wanted
    assert {type(record) for record in wanted} == {Delivered, Generated}


def test_a_folder_without_a_trace_and_a_line_that_is_none_are_named(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=str(tmp_path / "trace.jsonl")):
        list(records(tmp_path))
    whole = (folder / "trace.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    for broken in ("no record", '["delivered",1]', "\x00" * 20):
        (tmp_path / "trace.jsonl").write_text("".join([*whole[:3], broken, "\n", *whole[3:]]), encoding="utf-8")
        with pytest.raises(ConfigError, match="line 4"):
            list(records(tmp_path))
