"""Some seconds of files and folders of somebody else (`scripts/fuzz` is the long run), and that it would notice."""

from pathlib import Path

import foreign
import pytest

from fanet_mw.errors import ConfigError

INPUTS = 45


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> foreign.Corpus:
    return foreign.made(tmp_path_factory.mktemp("made"))


def fed(corpus: foreign.Corpus, root: Path, seeds: range) -> tuple[int, list[foreign.Wrong]]:
    answers = [foreign.feed(corpus, seed, root) for seed in seeds]
    return sum(refused for refused, _ in answers), [one for _, wrong in answers for one in wrong]


def test_what_somebody_else_has_made_is_used_or_refused_in_short_lines(corpus: foreign.Corpus, tmp_path: Path) -> None:
    refused, wrong = fed(corpus, tmp_path, range(INPUTS))
    assert wrong == [], "\n".join(map(str, wrong))
    assert INPUTS // 3 < refused < INPUTS, "some are refused, and some are as good as before"


def outside(_corpus: foreign.Corpus, folder: Path, _random: object) -> None:
    (folder.parent / "foreign").write_text("overwritten")


def beside(_corpus: foreign.Corpus, folder: Path, _random: object) -> None:
    (folder.parent / "more").touch()


def traceback(_corpus: foreign.Corpus, _folder: Path, _random: object) -> None:
    raise KeyError("pdr")


def long(_corpus: foreign.Corpus, _folder: Path, _random: object) -> None:
    raise ConfigError("\n".join(["x" * 700] * 30))


@pytest.mark.parametrize("bad", [outside, beside, traceback])
def test_an_answer_that_should_not_be_is_noticed(
    bad: object, corpus: foreign.Corpus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(foreign, "KINDS", (bad,))
    assert len(fed(corpus, tmp_path, range(1))[1]) == 1
    monkeypatch.setattr(foreign, "KINDS", (long,))
    assert fed(corpus, tmp_path, range(1)) == (1, []), "what is long is cut where it is printed"
