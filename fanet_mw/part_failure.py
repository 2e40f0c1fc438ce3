"""What a part of another package does wrong while it runs. None of it costs a run its result.

it raises             said in one line: parts:Finder.on_message (agent-3, at 3.2 s) has raised KeyError: 7
it calls os._exit     raised as HostError
its report() raises, tells what is no JSON, or uses names that results read otherwise: told all the same
"""

import math
import os
import threading
import traceback
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final, NoReturn

from fanet_mw.errors import FanetError, HostError
from fanet_mw.units import S

OURS: Final = ("fanet_mw", "agents", "emulator", "sim")
_DEEPEST: Final = 10
"""The depth of a report, which may be read wherever it is told; one that holds itself has none."""
_TOLD: Final[Mapping[str, tuple[type, ...]]] = {
    **dict.fromkeys(
        ("kind", "node", "generated", "bus_malformed", "heard_late", "messages", "applications", "frames_sent",
         "receptions", "dropped", "final", "host", "clock", "slots", "turns", "head", "cluster"), ()
    ),
    **dict.fromkeys(("missed_turns", "waiting", "leader", "term", "epoch"), (int,)),
    "bound_ms": (int, float, type(None)),
    **dict.fromkeys(("state", "role"), (str,)),
}  # fmt: skip
"""What results and views read of a node's report: what a protocol must not tell at all, or as values of which types."""
_LONGEST: Final = 300


def said_of(error: BaseException, foreign_modules: Collection[str], actors: Sequence[str], *, now_ns: int) -> str:
    """What `actors` were doing when one of them raised; the outermost function of a foreign module counts."""
    message = " ".join(str(error).split())[:_LONGEST]
    where = f"{', '.join(actors[:1])}, at {now_ns / S:g} s"
    causes = [error] if error.__cause__ is None else [error, error.__cause__]
    frames = [frame for cause in causes for frame, _ in traceback.walk_tb(cause.__traceback__)]
    foreign = [frame for frame in frames if _module(frame).partition(".")[0] in foreign_modules]
    if isinstance(error, FanetError) and not foreign:  # its message names the part
        return f"{message} ({where})"
    frame = (foreign or frames[-1:])[0]
    part = f"{_module(frame)}:{frame.f_code.co_qualname}"
    if isinstance(error, HostError):
        return f"{message} ({where}), in {part}"
    why = f"{type(error).__name__}: {message}".removesuffix(": ")
    return f"{part} ({where}) has raised {why}"


def said_at(error: BaseException) -> str | None:
    """File and line of a foreign module where an error was raised that the caller has caught; None if it was at the
    call itself, which the called function does not take.
    """
    found = [(frame, line) for frame, line in traceback.walk_tb(error.__traceback__)][1:]
    foreign = [at for at in found if _module(at[0]).partition(".")[0] not in OURS]
    if not found:
        return None
    frame, line = (foreign or found)[-1]
    return f"{frame.f_code.co_filename}:{line}"


def _module(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", ""))


@contextmanager
def exits_raised() -> Iterator[None]:
    """Raise HostError where this thread calls `os._exit`, which ends a process without a word, perhaps with 0; another
    thread ends it with a word and not with 0. A process that was forked meanwhile ends by it as always, or else here.
    """
    leave, process, thread = os._exit, os.getpid(), threading.get_ident()

    def say(status: int) -> NoReturn:
        if os.getpid() != process:
            leave(status)
        said = f"a part of another package has called os._exit({status!r})"
        if threading.get_ident() == thread:
            raise HostError(said)
        os.write(2, f"fanet: {said}\n".encode())
        leave(status or 1)

    os._exit = say
    try:
        yield
    finally:
        os._exit = leave
        if os.getpid() != process:
            os.write(2, b"fanet: a part of another package has called os.fork, and its child flew on: that ends here\n")
            leave(1)


def is_ours(part: object) -> bool:
    """True for what a class of this project has made."""
    return type(part).__module__.partition(".")[0] in OURS


def report_of(part: Any) -> dict[str, Any]:  # noqa: ANN401  (an application or a protocol)
    """The counters of a part. Those of another package are told in values of JSON, numbers that are none and whatever
    else as text, so that no run is lost for its last report.
    """
    if is_ours(part):
        return dict(part.report())
    try:
        told = _plain(part.report(), _DEEPEST)
    except Exception as error:  # noqa: BLE001  (whatever the code of another package raises)
        told = {"report_failed": f"{type(error).__name__}: {error}"}
    return told if isinstance(told, dict) else {} if told is None else {"report": told}


def protocol_report_of(protocol: Any) -> dict[str, Any]:  # noqa: ANN401
    """The counters of a protocol. What one of another package calls as results call something else is renamed."""
    told = report_of(protocol)
    if is_ours(protocol):
        return told
    return {key if _may_tell(key, value) else f"protocol.{key}": value for key, value in told.items()}


def _may_tell(key: str, value: object) -> bool:
    if key not in _TOLD:
        return True
    return isinstance(value, _TOLD[key]) and (not isinstance(value, int | float) or value >= 0)


def _plain(value: Any, depth: int) -> Any:  # noqa: ANN401
    if depth < 0:
        raise ValueError(f"deeper than {_DEEPEST}")
    if isinstance(value, Mapping):
        return {str(key): _plain(held, depth - 1) for key, held in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(held, depth - 1) for held in value]
    if isinstance(value, set | frozenset):
        return sorted((_plain(held, depth - 1) for held in value), key=str)
    if hasattr(value, "tolist"):  # of numpy
        return _plain(value.tolist(), depth - 1)
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if isinstance(value, int):
        return value if -(2**63) <= value < 2**63 else str(value)
    return value if value is None or isinstance(value, str) else str(value)
