"""What a new user tries and what cannot be: a sentence with the value and its bound, at once."""

from pathlib import Path

import pytest

from fanet_mw.bus.topics import Topics
from fanet_mw.errors import ConfigError
from fanet_mw.scenario import config
from sim.cli.app import app
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


def test_a_link_from_a_node_to_itself_is_refused_in_words() -> None:
    assert refusal("air", "degrade", "3", "3", "--loss-db", "3") == "degrade 3 3: a link has two different ends"
    assert refusal("air", "cut", "-1") == "cut -1: the id of a node must be within [1, 65534]"
    assert refusal("air", "degrade", "3", "0") == "degrade 3 0: the id of a node must be within [1, 65534]"


def test_an_instant_beyond_the_end_of_a_run_is_refused(tmp_path: Path) -> None:
    tree = {"duration_s": 2, "nodes": {"count": 2, "layout": "line"}, "clusters": {"count": 1},
            "mobility": {"model": "random_waypoint"}}  # fmt: skip
    finish(simulate(config.build(tree)), out=tmp_path)
    assert refusal("replay", str(tmp_path), "--at", "99") == "--at 99: must be within 0 and duration_s = 2"
