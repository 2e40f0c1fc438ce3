"""A run in real time that judges the protocol and not the machine: as long as a run says of itself that it is not
valid, the same swarm runs again, and its time passes more slowly.

    wall time 1 x -> valid: judge it | not valid -> 2 x -> 4 x -> the last one is judged, whatever it says

A slower swarm clock leaves all processes more wall time for the same requests, leads and turns
(docs/reference/validity.md says what makes a run not valid). What no run in real time may do, at no speed, is asked
of the last run as of any other.
"""

from collections.abc import Callable
from typing import Any, Final, TypeVar

from sim.results.files import finish
from sim.results.outcome import Outcome

SPEEDS: Final = (1.0, 0.5, 0.25)
LIMIT_S: Final = 300
"""For a test that may need all three runs."""

Run = TypeVar("Run")


def undisturbed(run: Callable[[str], Outcome]) -> tuple[Outcome, dict[str, Any]]:
    """The first valid run, or else the last; `run` is given the setting by which it is to slow its swarm down."""
    for speed in SPEEDS:
        outcome = run(f"time_scale={speed}")
        summary = finish(outcome, out=None)
        if summary["valid"]:
            break
        print(f"at {speed} of the wall's time:", *summary["invalid_because"], sep="\n  ")  # shown if the test fails
    return outcome, summary


def with_time_enough(run: Callable[[str], Run], enough: Callable[[Run], bool]) -> Run:
    """The first run in which there was time enough, or else the last: for runs with a fault, which are never valid."""
    for speed in SPEEDS:
        found = run(f"time_scale={speed}")
        if enough(found):
            break
    return found
