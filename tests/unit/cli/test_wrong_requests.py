"""What a new user tries and what cannot be: a sentence with the value and its bound, at once."""

import os
import sys
from pathlib import Path

import pytest
from cyclopts import CycloptsError

from fanet_mw.application import Application
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import ConfigError, HostError
from fanet_mw.scenario import config
from sim.cli.app import app, changes_last, misread, require_values
from sim.results.files import finish
from sim.run.virtual import simulate


def refusal(*tokens: str) -> str:
    with pytest.raises(ConfigError) as caught:
        app(list(tokens), result_action="return_value")
    return str(caught.value)


@pytest.mark.parametrize("name", ["a/b c", "a b", "*", "", "a$", "x" * 129])
def test_a_name_of_a_swarm_that_would_be_another_topic_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="is part of topics"):
        Topics(name)


def test_launch_refuses_it_before_it_says_anything_else(capsys: pytest.CaptureFixture[str]) -> None:
    assert refusal("launch", "flooding", "--swarm", "a/b c").startswith("the name of a swarm, 'a/b c', is part of")
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            "show quick --set nodes.count=4 nodes.count=6",
            "--set nodes.count=4 and nodes.count=6: one key has",
        ),
        ("simulate quick --set seed=4 --seed 6", "--set seed=4 and seed=6: one key has one value"),
        ("sweep quick --set nodes.count=4,5 nodes.count=6,7", "--set nodes.count=4,5 and nodes.count=6,7: one key has"),
    ],
)
def test_two_values_of_one_key_are_refused_and_both_are_named(words: str, said: str) -> None:
    assert refusal(*changes_last(words.split())).startswith(said)


@pytest.mark.parametrize(
    "words", ["air cut 2.5", "order recall 1.7", "simulate quick --seed 1.5", "sweep quick --seeds 2.2", "air cut inf"]
)
def test_a_number_that_is_not_whole_is_not_rounded_to_one(words: str) -> None:
    with pytest.raises(CycloptsError, match=f'unable to convert "{words.split()[-1]}"'):
        app(words.split(), result_action="return_value", exit_on_error=False, print_error=False)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--html run/trace.jsonl", "--html run/trace.jsonl: must be a file whose name ends in .html"),
        ("--map run/summary.json", "--map run/summary.json: must be a file whose name ends in .html"),
        ("--html a.html --map b.html", "--html and --map: one of them at a time"),
        ("--html a.html --at 3", "--html and --at: one of them at a time"),
        ("--html a.html --start 3", "--start and --html: only a replay in the browser begins later than at 0 s"),
        ("--map a.html --port 8081", "--port and --map: only a replay in the browser has a port"),
    ],
)
def test_a_replay_is_written_over_nothing_but_a_page_and_never_left_out(words: str, said: str) -> None:
    assert refusal("replay", "run", *words.split()) == said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("plan clusters nodes.count=200", "nodes.count=200; a key of the scenario is changed by --set nodes.count=200"),
        ("check quick quick", "quick"),
    ],
)
def test_words_too_many_are_named_and_a_change_without_set_is_known_as_one(words: str, said: str) -> None:
    with pytest.raises(CycloptsError) as caught:
        app(words.split(), result_action="return_value", exit_on_error=False, print_error=False)
    assert misread(caught.value) == f"not understood: {said}"


@pytest.mark.parametrize("words", [["simulate", "quick", "--out", ""], ["launch", "--out=", "quick"]])
def test_an_option_whose_value_is_empty_is_refused(words: list[str]) -> None:
    """`--out "$RUNS"` without such a variable wrote the run into the working folder, with `--force` over another."""
    with pytest.raises(ConfigError, match="--out: its value is empty"):
        require_values(words)
    require_values(["simulate", "quick", "--out", ".", "--set", "world.heightmap=", "--set=world.heightmap=", "--json"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("launch quick --autopilots udpin:127.0.0.1:14540+", "--autopilots: needs --no-world"),
        ("launch quick --mavlink bogus", "--mavlink bogus: must be"),
        ("launch quick --set world.no_fly_m=[[0,0,500]]", "node 1 starts within it"),
        ("simulate quick --set world.no_fly_m=[[0,0,500]]", "node 1 starts within it"),
    ],
)
def test_a_refused_request_costs_no_result_that_it_was_to_replace(words: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text("{}")
    (tmp_path / "run.mcap").write_text("of another run")
    recording = ["--record", str(tmp_path / "run.mcap"), "--force"]
    assert said in refusal(*words.split(), "--out", str(tmp_path), *recording)
    assert "/proc/x: cannot be written" in refusal("simulate", "quick", "--out", "/proc/x", *recording)
    assert (tmp_path / "summary.json").read_text() == "{}"
    assert (tmp_path / "run.mcap").read_text() == "of another run"


def test_a_folder_for_the_dialect_that_cannot_be_made_is_no_fault_of_pymavlink() -> None:
    assert refusal("dialect", "/proc/nowhere") == "/proc/nowhere/v1.0: cannot be written: No such file or directory"


def test_receptions_without_a_capture_are_refused() -> None:
    assert refusal("emulator", "quick", "--pcap-receptions") == "--pcap-receptions: needs --pcap FILE"


def test_a_link_from_a_node_to_itself_is_refused_in_words() -> None:
    assert refusal("air", "degrade", "3", "3", "--loss-db", "3") == "degrade link-3-3: a link has two different ends"
    assert refusal("air", "cut", "-1") == "cut -1: the id of a node must be within [1, 65534]"
    assert refusal("air", "degrade", "3", "0") == "degrade 3 0: the id of a node must be within [1, 65534]"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("cut 5 --for nan", "--for nan: must be in [0, 1e+06] s"),
        ("cut 5 --for inf", "--for inf: must be in [0, 1e+06] s"),
        ("cut 5 --for -3", "--for -3: must be in [0, 1e+06] s"),
        ("cut 5 --label \u00fc", "cut \u00fc: a label has 1 to 32 characters of ASCII"),
        ("degrade 1 2 --loss-share 2", "degrade link-1-2: loss_share = 2 must be in [0, 1]"),
        ("degrade 1 2 --loss-db nan", "degrade link-1-2: loss_db = nan must be in [0, 300]"),
        ("jam 0 0 0", "jam jam: radius_m = 0 must be > 0"),
        ("jam 0 0 nan", "jam jam: radius_m = nan must be > 0"),
        ("jam 0 0 1e9", "jam jam: radius_m = 1e+09 must be in [-1e+07, 1e+07]"),
        ("jam nan 0 9", "jam jam: east = nan must be in [-1e+07, 1e+07]"),
        ("jam 0 0 9 --noise-dbm 101", "jam jam: noise_dbm = 101 must be in [-300, 100]"),
        ("partition 0 0 0 0", "partition partition: a line goes through two different points"),
        ("partition 0 0 0 inf", "partition partition: line_m = inf must be in [-1e+07, 1e+07]"),
        ("battery 3 2", "battery node-3: charge = 2 must be in [0, 1]"),
        ("gps 3 --offset-m nan 0 0", "gps node-3: offset_m = nan must be in [-1e+07, 1e+07]"),
    ],
)
def test_a_change_of_the_air_beyond_its_bounds_is_refused_with_its_value(words: str, said: str) -> None:
    assert refusal("air", *words.split()) == said


def test_an_instant_beyond_the_end_of_a_run_is_refused(tmp_path: Path) -> None:
    tree = {"duration_s": 2, "nodes": {"count": 2, "layout": "line"}, "clusters": {"count": 1},
            "mobility": {"model": "random_waypoint"}}  # fmt: skip
    finish(simulate(config.build(tree)), out=tmp_path)
    assert refusal("replay", str(tmp_path), "--at", "99") == "--at 99: must be within 0 and duration_s = 2"
    assert (
        refusal("replay", str(tmp_path), "--start", "9") == f"--start 9: must be within 0 and 2, the end of {tmp_path}"
    )


@pytest.mark.parametrize("code", [0, None, "done"])
def test_a_part_that_calls_exit_does_not_end_a_run_as_if_it_were_right(code: object) -> None:
    class Leaving(Application):
        name = "leaving"

        def next_wake_ns(self) -> int:
            return 1_000_000_000

        def wake(self, now_ns: int) -> None:
            sys.exit(code)  # type: ignore[arg-type]

    scenario = config.build({"nodes": {"count": 1}, "duration_s": 2, "routing": {"protocol": "flooding"}})
    with pytest.raises(HostError, match=rf"has called sys.exit\({code!r}\) at 1 s"):
        simulate(scenario, applications=lambda _: [Leaving()])


def test_a_copy_of_the_process_that_a_part_has_forked_does_not_fly_on(capfd: pytest.CaptureFixture[str]) -> None:
    children, process = [], os.getpid()

    class Forking(Application):
        name = "forking"

        def next_wake_ns(self) -> int | None:
            return None if children else 1_000_000_000

        def wake(self, now_ns: int) -> None:
            children.append(os.fork())

    scenario = config.build({"nodes": {"count": 1}, "duration_s": 2, "routing": {"protocol": "flooding"}})
    outcome = simulate(scenario, applications=lambda _: [Forking()])
    if os.getpid() != process:
        os._exit(0)  # it has flown on
    assert outcome.aborted is None
    assert os.waitstatus_to_exitcode(os.waitpid(children[0], 0)[1]) == 1
    assert "has called os.fork, and its child flew on: that ends here" in capfd.readouterr().err
