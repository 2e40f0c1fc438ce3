"""`fanet init`, `show`, `check`, `schema`, completion, and `--set`: what a person does before a run."""

import json
import os
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from fanet_mw.errors import ConfigError
from sim.cli.app import app, changes_last, refused
from sim.scenarios import catalog


def fanet(*words: str) -> int:
    return int(app(words, result_action="return_value"))


def test_what_init_recommends_can_be_typed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "Über mine's.toml"
    fanet("init", str(file), "--short")
    said = capsys.readouterr().err
    for command in said.partition("next: ")[2].split(", "):
        assert shlex.split(command)[2:] == [str(file)]


def test_from_init_over_check_to_show(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mine.toml"
    assert fanet("init", str(file), "--from", "flooding") == 0
    assert "next: fanet check" in capsys.readouterr().err
    file.write_text(file.read_text().replace("# hop_limit = 32", "hop_limit = 5"))

    assert fanet("check", str(file)) == 0
    assert "scenario mine is right: 45 nodes" in capsys.readouterr().out
    assert fanet("show", str(file)) == 0
    shown = tomllib.loads(capsys.readouterr().out)
    assert shown["routing"] == {**catalog.find("flooding").model_dump(mode="json")["routing"], "hop_limit": 5}

    with pytest.raises(ConfigError, match="is there already"):
        fanet("init", str(file))
    assert fanet("init", str(file), "--force", "--short", "--schema") == 0
    assert json.loads((tmp_path / "fanet-scenario.schema.json").read_text())["title"] == "fanet-mw scenario"
    assert "hop_limit" not in file.read_text()


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_locale_without_the_letters_of_a_scenario_costs_none_of_them(tmp_path: Path, encoding: str) -> None:
    """`LC_ALL=C` ended `fanet check` and `fanet show` in a traceback; in Latin-1 what was shown was no TOML."""
    file = tmp_path / "größe.toml"
    file.write_text('description = "Größe Ω \U0001f681"\nduration_s = 3\n', encoding="utf-8")

    def said(*words: str) -> bytes:
        command = [sys.executable, "-m", "sim", *words, str(file)]
        environment = os.environ | {"PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
        return subprocess.run(command, env=environment, check=True, capture_output=True, timeout=60).stdout

    assert b"is right: 45 nodes" in said("check")
    assert tomllib.loads(said("show").decode("utf-8"))["description"] == "Größe Ω \U0001f681"


def test_init_starts_from_a_file_that_names_others_beside_it(tmp_path: Path) -> None:
    """It said that such keys are read with a scenario file only, which it was."""
    (tmp_path / "load.csv").write_text("0,100\n1,200\n")
    first, second = tmp_path / "first.toml", tmp_path / "second.toml"
    first.write_text('duration_s = 9\n[traffic]\narrivals = "trace"\npackets_csv = "load.csv"\n')
    assert fanet("init", str(second), "--from", str(first), "--short") == 0
    assert catalog.find(second).traffic.packets == ((0.0, 100), (1.0, 200))
    with pytest.raises(ConfigError, match=r"elsewhere/load\.csv: cannot be read"):
        fanet("init", str(tmp_path / "elsewhere" / "third.toml"), "--from", str(first))


def test_a_wrong_file_is_told_every_mistake(tmp_path: Path) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text('duration_s = "3 m"\n')
    with pytest.raises(ConfigError, match="'m' is not understood"):
        fanet("check", str(file))
    file.write_text("[radio]\nled_ms = 3\nrange_m = -1\n")
    with pytest.raises(ConfigError, match=r"range_m = -1(.|\n)*did you mean lead_ms"):
        fanet("check", str(file))


def test_only_what_was_changed_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        fanet("show", "quick", "--changed", "--set", "nodes.count=12", "radio.range_m=0.3km", "--duration", "1min") == 0
    )
    shown = tomllib.loads(capsys.readouterr().out)
    assert shown["nodes"] == {"count": 12, "spacing_m": 150.0}
    assert shown["radio"] == {"range_m": 300.0}
    assert shown["duration_s"] == 60.0


def test_set_is_repeatable_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert fanet("show", "quick", "--set", "nodes.count=12", "--set", "seed=4", "--json") == 0
    shown = json.loads(capsys.readouterr().out)
    assert (shown["nodes"]["count"], shown["seed"]) == (12, 4)


@pytest.mark.parametrize(
    "line",
    ["quick --set nodes.count=12 seed=4 --json", "--set nodes.count=12 seed=4 quick --json",
     "--json --set nodes.count=12 quick --set=seed=4", "--set nodes.count=12 --json --set seed=4 -- quick"],
)  # fmt: skip
def test_what_is_set_may_stand_before_the_scenario(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert fanet("show", *changes_last(line.split())) == 0
    shown = json.loads(capsys.readouterr().out)
    assert (shown["nodes"]["count"], shown["seed"]) == (12, 4)


def test_words_that_set_nothing_are_refused_by_name() -> None:
    with pytest.raises(ConfigError, match=r"'nodes\.count': must be KEY=VALUE"):
        fanet(*changes_last(["show", "--set", "nodes.count", "quick"]))


def test_what_an_error_says_is_printed_as_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert refused("[bold]x = 3 must be in [1, 2]") == 2
    assert capsys.readouterr().err == "fanet: [bold]x = 3 must be in [1, 2]\n"


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (("simulate", "cro"), "crossing"),
        (("init", "x.toml", "--from", "hid"), "hidden_terminal"),
        (("launch", "quick", "--set", "radio.lead"), "radio.lead_ms="),
    ],
)
def test_the_shell_completes_commands_scenarios_and_keys(
    words: tuple[str, ...], offered: str, capsys: pytest.CaptureFixture[str]
) -> None:
    app._run_complete(words)
    assert offered in capsys.readouterr().out


_TYPED = {("simul",): "simulate", ("simulate", "resc"): "rescue", ("simulate", "--set", "clusters.rela"): "relay="}


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_completes_by_the_installed_script(tmp_path: Path) -> None:
    script = tmp_path / "fanet.bash"
    script.write_text(app.generate_completion(shell="bash"), encoding="utf-8")
    completer = tmp_path / "fanet"
    completer.write_text(f'#!/bin/sh\nexec {sys.executable} -m sim "$@"\n', encoding="utf-8")
    completer.chmod(0o755)
    asked = [
        f"COMP_WORDS=(fanet {' '.join(words)}) COMP_CWORD={len(words)} COMPREPLY=(); $complete; echo ${{COMPREPLY[*]}}"
        for words in _TYPED
    ]
    lines = [f"source {script}", "complete=$(complete -p fanet | sed 's/.*-F *//; s/ .*//')", *asked]
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    told = subprocess.run(
        ["bash", "--norc", "-c", "\n".join(lines)], env=environment, capture_output=True, text=True, check=False
    )
    offered = told.stdout.splitlines()
    assert [word in line for word, line in zip(_TYPED.values(), offered, strict=True)] == [True] * 3, told
