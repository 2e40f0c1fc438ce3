"""The state machine of a node's role: (state, event) -> (state, action). After the start no other code changes a state.

`failover.py` finds the events and asks for a row. A combination without a row cannot happen, and would raise. The
diagram in docs/explanation/roles.md is generated from the table by `scripts/generate_state_diagram.py`.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final, NamedTuple


class State(StrEnum):
    """The role of a node at the moment."""

    SEEKING = "seeking"
    """The node belongs to no cluster."""
    MEMBER = "member"
    HEAD = "head"
    """The node is the head that the schedule names."""
    ACTING = "acting"
    """The node is a member that stands in for its silent head. It uses the head's slot, except with a timetable, where
    it only informs the leader."""
    LEADING = "leading"
    """The node is the leader; it belongs to no cluster once it has announced a schedule."""


class Event(StrEnum):
    """The events that may change the state of a node."""

    NAMED_MEMBER = "schedule names it member"
    NAMED_HEAD = "schedule names it head"
    LEFT_OUT = "schedule leaves it out"
    NEW_LEADER = "another leader prevails"
    LEADER_SILENT = "leader silent, its turn"
    HEAD_SILENT = "head silent, its turn"
    HEAD_REPLACED = "another stands in for the head"
    HEAD_BACK = "the named head lives"
    SAID_SILENT = "said to be silent"


class Action(StrEnum):
    """What a node does when its state changes."""

    FOLLOW = "follow the head"
    SERVE = "own the slot"
    LEAVE = "give up the role, join"
    JOIN = "join"
    CALL = "take office, call for joins"
    RESIGN = "give up the role"
    STEP_DOWN = "give up office, join"
    TAKE_OVER = "own the slot, tell everyone"
    OBJECT = "tell everyone that it lives"


class Row(NamedTuple):
    """The new state, and the action of the transition."""

    state: State
    action: Action


TRANSITIONS: Final[Mapping[tuple[State, Event], Row]] = {
    (State.SEEKING, Event.NAMED_MEMBER): Row(State.MEMBER, Action.FOLLOW),
    (State.SEEKING, Event.NAMED_HEAD): Row(State.HEAD, Action.SERVE),
    (State.SEEKING, Event.LEFT_OUT): Row(State.SEEKING, Action.JOIN),
    (State.SEEKING, Event.NEW_LEADER): Row(State.SEEKING, Action.JOIN),
    (State.SEEKING, Event.LEADER_SILENT): Row(State.LEADING, Action.CALL),
    (State.MEMBER, Event.NAMED_MEMBER): Row(State.MEMBER, Action.FOLLOW),
    (State.MEMBER, Event.NAMED_HEAD): Row(State.HEAD, Action.SERVE),
    (State.MEMBER, Event.LEFT_OUT): Row(State.SEEKING, Action.LEAVE),
    (State.MEMBER, Event.NEW_LEADER): Row(State.MEMBER, Action.JOIN),
    (State.MEMBER, Event.LEADER_SILENT): Row(State.LEADING, Action.CALL),
    (State.MEMBER, Event.HEAD_SILENT): Row(State.ACTING, Action.TAKE_OVER),
    (State.MEMBER, Event.HEAD_REPLACED): Row(State.MEMBER, Action.FOLLOW),
    (State.MEMBER, Event.HEAD_BACK): Row(State.MEMBER, Action.FOLLOW),
    (State.MEMBER, Event.SAID_SILENT): Row(State.MEMBER, Action.OBJECT),
    (State.HEAD, Event.NAMED_MEMBER): Row(State.MEMBER, Action.FOLLOW),
    (State.HEAD, Event.NAMED_HEAD): Row(State.HEAD, Action.SERVE),
    (State.HEAD, Event.LEFT_OUT): Row(State.SEEKING, Action.LEAVE),
    (State.HEAD, Event.NEW_LEADER): Row(State.HEAD, Action.JOIN),
    (State.HEAD, Event.LEADER_SILENT): Row(State.LEADING, Action.CALL),
    (State.HEAD, Event.HEAD_REPLACED): Row(State.HEAD, Action.OBJECT),
    (State.HEAD, Event.SAID_SILENT): Row(State.HEAD, Action.OBJECT),
    (State.ACTING, Event.NAMED_MEMBER): Row(State.MEMBER, Action.FOLLOW),
    (State.ACTING, Event.NAMED_HEAD): Row(State.HEAD, Action.SERVE),
    (State.ACTING, Event.LEFT_OUT): Row(State.SEEKING, Action.LEAVE),
    (State.ACTING, Event.NEW_LEADER): Row(State.ACTING, Action.JOIN),
    (State.ACTING, Event.LEADER_SILENT): Row(State.LEADING, Action.CALL),
    (State.ACTING, Event.HEAD_SILENT): Row(State.ACTING, Action.TAKE_OVER),
    (State.ACTING, Event.HEAD_REPLACED): Row(State.MEMBER, Action.FOLLOW),
    (State.ACTING, Event.HEAD_BACK): Row(State.MEMBER, Action.FOLLOW),
    (State.ACTING, Event.SAID_SILENT): Row(State.ACTING, Action.OBJECT),
    (State.LEADING, Event.LEFT_OUT): Row(State.LEADING, Action.RESIGN),
    (State.LEADING, Event.NEW_LEADER): Row(State.SEEKING, Action.STEP_DOWN),
}


def step(state: State, event: Event) -> Row:
    row = TRANSITIONS.get((state, event))
    assert row is not None, f"{state} has no transition for: {event}"
    return row


def mermaid() -> str:
    """The table as a Mermaid state diagram: one arrow per pair of states, and a line per event."""
    arrows: dict[tuple[State, State], list[str]] = {}
    for (state, event), row in TRANSITIONS.items():
        arrows.setdefault((state, row.state), []).append(f"{event} / {row.action}")
    lines = ["stateDiagram-v2", "    [*] --> seeking", "    [*] --> leading: node 1"]
    lines += [f"    {a} --> {b}: {'<br/>'.join(labels)}" for (a, b), labels in arrows.items()]
    return "\n".join(lines) + "\n"
