"""Says in one line which part of another package has raised in virtual time, and what.

applications  parts:Finder.on_message (agent-3, at 3.2 s) has raised ZeroDivisionError: division by zero
none          agents.uav:Uav.wake (agent-3, at 3.2 s) has raised KeyError: 7
"""

import traceback
from collections.abc import Sequence
from types import FrameType
from typing import Final

from fanet_mw.errors import FanetError
from fanet_mw.scenario import Scenario
from fanet_mw.scenario.fingerprint import modules_of
from fanet_mw.units import S

_LONGEST: Final = 300


def said_of(error: BaseException, scenario: Scenario, actors: Sequence[str], *, now_ns: int) -> str:
    """What `actors` were doing when one of them raised; the outermost function of a foreign part counts."""
    message = " ".join(str(error).split())[:_LONGEST]
    where = f"{', '.join(actors[:1])}, at {now_ns / S:g} s"
    if isinstance(error, FanetError):  # its message names the part
        return f"{message} ({where})"
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    foreign = [frame for frame in frames if _module(frame).partition(".")[0] in modules_of(scenario)]
    frame = (foreign or frames[-1:])[0]
    why = f"{type(error).__name__}: {message}".removesuffix(": ")
    return f"{_module(frame)}:{frame.f_code.co_qualname} ({where}) has raised {why}"


def _module(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", ""))
