"""The table of a node's part in the swarm, and the diagram made of it."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

from fanet_mw.routing.clustered.roles.states import TRANSITIONS, Action, Event, State, mermaid

ROOT = Path(__file__).parents[5]


@pytest.fixture
def script() -> ModuleType:
    path = ROOT / "scripts" / "generate_state_diagram.py"
    spec = importlib.util.spec_from_file_location("generate_state_diagram", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_state_is_reached_and_left_and_every_event_and_action_is_used() -> None:
    assert {row.state for row in TRANSITIONS.values()} == set(State)
    assert {state for state, _ in TRANSITIONS} == set(State)
    assert {event for _, event in TRANSITIONS} == set(Event)
    assert {row.action for row in TRANSITIONS.values()} == set(Action)


@pytest.mark.parametrize("state", [state for state in State if state is not State.LEADING])
def test_whoever_does_not_lead_obeys_any_schedule_and_may_be_the_next_leader(state: State) -> None:
    assert TRANSITIONS[state, Event.NAMED_MEMBER].state is State.MEMBER
    assert TRANSITIONS[state, Event.NAMED_HEAD].state is State.HEAD
    assert TRANSITIONS[state, Event.LEFT_OUT].state is State.SEEKING
    assert TRANSITIONS[state, Event.LEADER_SILENT].state is State.LEADING


def test_the_diagram_has_each_transition() -> None:
    text = mermaid()
    assert all(f"{event} / {row.action}" in text for (_, event), row in TRANSITIONS.items())
    assert "leading --> seeking" in text


def test_the_document_shows_the_table(script: ModuleType) -> None:
    assert script.main(["--check"]) == 0


def test_another_diagram_fails_the_check_and_is_put_right(
    script: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "protocol.md"
    copy.write_text(script.DOCUMENT.read_text(encoding="utf-8").replace("leading --> seeking", "leading --> head"))
    assert script.main(["--check"], document=copy) == 1
    assert "run scripts/generate_state_diagram.py" in capsys.readouterr().err
    assert script.main([], document=copy) == 0
    assert script.main(["--check"], document=copy) == 0
    assert copy.read_text(encoding="utf-8") == script.DOCUMENT.read_text(encoding="utf-8")


def test_without_its_markers_a_document_is_left_alone(
    script: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "protocol.md"
    copy.write_text("no diagram here\n")
    assert script.main([], document=copy) == 1
    assert "must hold " in capsys.readouterr().err
    assert copy.read_text() == "no diagram here\n"
    assert script.main(["--chekc"], document=copy) == 2
