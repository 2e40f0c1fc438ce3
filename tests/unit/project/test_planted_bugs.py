"""The tool that plants bugs, on a tree of one file and one test."""

from pathlib import Path

import pytest

from tests.mutants import plant
from tests.mutants.plant import Mutant

SOURCE = "def half(n):\n    return n // 2  # rounded down\n\n\ndef twice(n):\n    return n * 2  # exact\n"
TEST = "from numbers_of import half\n\n\ndef test_half():\n    assert half(7) == 3\n"


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    root = tmp_path / "tree"
    (root / "tests").mkdir(parents=True)
    (root / "numbers_of.py").write_text(SOURCE)
    (root / "tests" / "test_numbers.py").write_text(TEST)
    (root / "tests" / "conftest.py").write_text(
        "from hypothesis import settings\nsettings.register_profile('mutants', deadline=None)\n"
    )
    monkeypatch.setattr(plant, "ROOT", root)
    return root


def bug(old: str, new: str, *, after: str = "", test: str = "test_numbers.py") -> Mutant:
    return Mutant("numbers_of.py", "it halves", old, new, after, (test,), sample=False)


@pytest.mark.slow  # six times pytest in a process of its own
def test_a_bug_is_caught_by_a_test_that_fails_survives_one_that_does_not_or_keeps_it_from_running(
    tree: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    noticed, unnoticed, nonsense = bug("n // 2", "n // 3"), bug("n * 2", "n * 3"), bug("def half(n):", "def half(n")
    assert plant.plant([noticed, unnoticed, nonsense], jobs=1) == 1
    said = capsys.readouterr().out
    assert "3 bugs: 1 caught (0 by long tests only), 1 survived" in said
    assert "- n * 2\n    + n * 3" in said
    assert "not judged" in said
    assert (tree / "numbers_of.py").read_text() == SOURCE, "bugs are planted in a copy"
    assert plant.plant([noticed], jobs=1) == 0


@pytest.mark.slow  # four times pytest in a process of its own
@pytest.mark.parametrize(("also", "status"), [("", "1 caught (1 by"), ("    assert half(8) == 5\n", "0 caught (0 by")])
def test_a_bug_that_only_a_long_test_notices_is_said_to_be_and_a_long_test_that_fails_anyway_shows_none(
    tree: Path, capsys: pytest.CaptureFixture[str], also: str, status: str
) -> None:
    long_test = "\n\n@pytest.mark.slow\ndef test_twice():\n    assert twice(2) == 4\n"
    text = TEST.replace("import half", "import half, twice") + long_test + also
    (tree / "tests" / "test_numbers.py").write_text("import pytest\n" + text)
    plant.plant([bug("n * 2", "n * 3")], jobs=1)
    assert status in capsys.readouterr().out


@pytest.mark.parametrize(
    ("default", "long", "status"),
    [
        (plant.NOTICED, plant.PASSED, "caught"),
        (None, plant.PASSED, "caught"),
        (plant.PASSED, plant.NOTICED, plant.BY_LONG),
        (plant.NONE_CHOSEN, plant.NOTICED, plant.BY_LONG),
        (plant.PASSED, plant.PASSED, "survived"),
        (plant.PASSED, plant.NONE_CHOSEN, "survived"),
        (plant.NONE_CHOSEN, plant.PASSED, "survived"),
        (plant.NONE_CHOSEN, plant.NONE_CHOSEN, "not judged"),
        (plant.PASSED, None, "not judged"),
        (2, plant.NOTICED, "not judged"),
    ],
)
def test_a_bug_is_tried_by_the_default_tests_first(
    monkeypatch: pytest.MonkeyPatch, default: int | None, long: int | None, status: str
) -> None:
    def answer(*_: object, chosen: str = plant.DEFAULT, **__: object) -> tuple[int | None, str]:
        return (long if chosen == plant.LONG else default), ""

    monkeypatch.setattr(plant, "pytest_in", answer)
    assert plant.verdict_of(Path(), ["test_numbers.py"]).startswith(status)


@pytest.mark.slow
def test_without_any_bug_the_tests_must_pass(tree: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tree / "tests" / "test_numbers.py").write_text(TEST.replace("== 3", "== 4"))
    assert plant.plant([bug("n // 2", "n // 3")], jobs=1) == 1
    assert "without any bug the tests do not pass" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("mutant", "why"),
    [
        (bug("n // 2", "n // 3"), None),
        (bug("2", "3", after="def twice"), None),
        (bug("2", "3"), "not once, but 2 times"),
        (bug("n // 4", "n // 3"), "not once, but 0 times"),
        (bug("n // 2", "n // 3", after="def twice"), "not behind"),
        (bug("n // 2", "n // 3", test="test_others.py"), "there is no test"),
        (bug("n // 2", "n // 3", test="test_numbers.py::test_third"), "there is no test"),
        (bug("n // 2", "n // 2"), "it must change one line"),
    ],
)
def test_a_bug_whose_place_is_not_clear_is_named(tree: Path, mutant: Mutant, why: str | None) -> None:
    found = plant.wrong(mutant)
    assert found is None if why is None else found is not None and why in found


def test_of_two_places_the_one_behind_the_given_text_is_meant() -> None:
    assert bug("2", "3", after="def twice").planted(SOURCE) == SOURCE.replace("n * 2", "n * 3")


def test_every_bug_of_the_list_can_be_planted_and_eight_are_the_sample() -> None:
    mutants = plant.read()
    assert [f"{mutant}: {why}" for mutant in mutants if (why := plant.wrong(mutant))] == []
    assert len(mutants) >= 150
    assert sum(mutant.sample for mutant in mutants) == 8
    assert len({(m.path, m.rule) for m in mutants}) == len(mutants), "each has a name of its own"
