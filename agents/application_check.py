"""Refuses applications that nobody could call or name, before the UAV starts: each is named with its class."""

from collections.abc import Collection
from typing import Final

from agents.submission import MOST_PORT, is_port
from fanet_mw.application import ANY, Application, Fate
from fanet_mw.errors import LocalProtocolError
from fanet_mw.part_signature import misfit

_MOST_MESSAGE_ID: Final = (1 << 24) - 1
"""MAVLink 2: ids have three bytes."""
_LONGEST_NAME: Final = 64


def said(application: Application) -> str:
    """How an application is named in an error."""
    return f"application {application.name!r} ({type(application).__module__}:{type(application).__qualname__})"


def require_application(application: Application) -> None:
    """Raise LocalProtocolError for attributes that mean nothing, and methods that cannot be called."""
    name = application.name
    if not isinstance(name, str) or not (0 < len(name) <= _LONGEST_NAME and name.isprintable()):
        raise LocalProtocolError(f"{said(application)}: name must be text of 1 to {_LONGEST_NAME} printable characters")
    if (wrong := misfit(type(application), Application)) is not None:  # type: ignore[arg-type]  # a class is hashable
        raise LocalProtocolError(f"{said(application)} {wrong}")
    _require(application, "ports", all(map(is_port, _values(application.ports))), f"numbers in [1, {MOST_PORT}]")
    known = all(type(i) is int and 0 <= i <= _MOST_MESSAGE_ID for i in _values(application.listens))
    _require(application, "listens", known, f"ids of messages in [0, {_MOST_MESSAGE_ID}]")
    _require(application, "follows", all(fate in list(Fate) for fate in _values(application.follows)), "fates")


def _values(told: object) -> Collection[object]:
    """The members of a collection; what is none has a member that nothing allows."""
    if told == ANY:
        return ()
    return told if isinstance(told, Collection) and not isinstance(told, str | bytes) else (None,)


def _require(application: Application, attribute: str, known: bool, what: str) -> None:
    if not known:
        value = getattr(application, attribute)
        raise LocalProtocolError(f"{said(application)}: {attribute} = {value!r:.120} must be a collection of {what}")
