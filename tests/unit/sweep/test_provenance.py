"""The code of a row: what it notices, and what it does not."""

from pathlib import Path

from sim.scenarios.shipped import entry
from sim.sweep.provenance import digest
from sim.sweep.spec import Sweep
from sim.sweep.tasks import tasks_of


def test_the_code_of_a_row_is_the_names_and_contents_of_its_sources(tmp_path: Path) -> None:
    one, other = tmp_path / "one.py", tmp_path / "other.py"
    one.write_text("LIMIT = 3\n")
    other.write_text("LIMIT = 4\n")
    assert digest({"a.py": one, "b.py": other}) == digest({"a.py": one, "b.py": other})
    found = [digest({"a.py": one}), digest({"a.py": other}), digest({"b.py": one}), digest({"a.py": one, "b.py": one})]
    assert len(set(found)) == 4


def test_a_changed_scenario_file_gives_runs_other_keys(tmp_path: Path) -> None:
    text = entry("flooding").text

    def keys(content: str) -> list[str]:
        path = tmp_path / "flooding.toml"
        path.write_text(content, "utf-8")
        return [task.key for task in tasks_of(Sweep(base=str(path)))]

    assert keys(text) == [task.key for task in tasks_of(Sweep(base="flooding"))]
    assert keys(f"# a comment\n{text}") == keys(text)
    assert "count = 45" in text
    assert keys(text.replace("count = 45", "count = 44")) != keys(text)
