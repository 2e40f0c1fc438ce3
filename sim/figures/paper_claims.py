"""The claims of the paper about a figure, and verdicts on them; both are code over the table of a sweep.

A claim consists of statements: a quantity with one value per seed, and the side of a threshold on which it is expected.
One holds if the whole 95 % interval of the mean is on that side, fails if it is wholly on the other, and is else open.
A claim agrees if all hold, differs if all fail, and is otherwise partly so. A reason is an experiment over the same
runs that would come out differently if it were wrong; it counts as shown if all its statements hold.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final, Literal

from sim.figures.statistics import ANY, SHARE, Interval, Possible, interval

BEYOND: Final = "(Beyond the paper) "
"""The text before a claim that is not the paper's."""
NEARLY_ALL: Final = 0.99
"""The packet delivery ratio from which on a claim says that all packets arrive."""
Values = Sequence[float] | Mapping[int, float]
"""One value per seed, or the value of each seed."""


class Verdict(StrEnum):
    """The verdict of a claim."""

    AGREES = "agrees"
    PARTLY = "partly"
    DIFFERS = "differs"


class Finding(StrEnum):
    """The finding of a statement."""

    HOLDS = "holds"
    FAILS = "fails"
    OPEN = "open"


@dataclass(frozen=True, slots=True)
class Statement:
    """A quantity with one value per seed, and the side of a threshold on which a claim expects it."""

    what: str
    values: Sequence[float]
    side: Literal["above", "below"]
    threshold: float
    unit: str = ""
    possible: Possible = ANY
    """The values that the quantity can have; the interval of its mean is cut to them."""

    @property
    def interval(self) -> Interval:
        return interval(self.values, self.possible)

    @property
    def finding(self) -> Finding:
        found = self.interval
        below, above = found.high <= self.threshold, found.low > self.threshold
        if not (below or above):
            return Finding.OPEN
        return Finding.HOLDS if above == (self.side == "above") else Finding.FAILS

    def text(self, verb: str = "claimed") -> str:
        """The statement as text, with the figures; the verb says whose threshold it is."""
        bound = f"{self.side} {self.threshold:g}{f' {self.unit}' if self.unit else ''}"
        return f"{self.what}: {self.interval.text(self.unit)}, {verb} {bound}: {self.finding}"

    def plain(self, verb: str = "claimed") -> dict[str, Any]:
        return {
            "what": self.what,
            **self.interval.plain(),
            "side": self.side,
            "threshold": self.threshold,
            "unit": self.unit,
            "finding": self.finding.value,
            "text": self.text(verb),
        }


def above(what: str, values: Values, threshold: float, unit: str = "", *, possible: Possible = ANY) -> Statement:
    return Statement(what, _listed(values), "above", threshold, unit, possible)


def below(what: str, values: Values, threshold: float, unit: str = "", *, possible: Possible = ANY) -> Statement:
    return Statement(what, _listed(values), "below", threshold, unit, possible)


def share_above(what: str, share: Values, threshold: float) -> Statement:
    return above(what, share, threshold, possible=SHARE)


def share_below(what: str, share: Values, threshold: float) -> Statement:
    return below(what, share, threshold, possible=SHARE)


def alike(what: str, values: Values, within: float) -> list[Statement]:
    """Two statements that hold together if a difference lies within a limit on either side."""
    return [above(what, values, -within), below(what, values, within)]


def _listed(values: Values) -> Sequence[float]:
    return list(values.values()) if isinstance(values, Mapping) else values


@dataclass(frozen=True, slots=True)
class Reason:
    """The explanation of a verdict, and the experiment that shows it."""

    text: str
    statements: Sequence[Statement]
    set_afterwards: str = ""
    """Which part of it was chosen after such runs had been seen, and is therefore not tested by them."""

    @property
    def shown(self) -> bool:
        """True if all statements hold; a reason without statements is not shown."""
        return {statement.finding for statement in self.statements} == {Finding.HOLDS}

    def plain(self) -> dict[str, Any]:
        return {
            "text": self.text,
            "shown": self.shown,
            "set_afterwards": self.set_afterwards,
            "statements": [statement.plain("expected") for statement in self.statements],
        }


@dataclass(frozen=True, slots=True)
class Claim:
    """One sentence of the paper, and the statements that decide about it."""

    figure: int
    claim: str
    statements: Sequence[Statement]
    reasons: Sequence[Reason] = ()

    @property
    def verdict(self) -> Verdict:
        findings = {statement.finding for statement in self.statements}
        if findings == {Finding.HOLDS}:
            return Verdict.AGREES
        return Verdict.DIFFERS if findings == {Finding.FAILS} else Verdict.PARTLY

    def plain(self) -> dict[str, Any]:
        return {
            "figure": self.figure,
            "claim": self.claim,
            "verdict": self.verdict.value,
            "statements": [statement.plain() for statement in self.statements],
            "reasons": [reason.plain() for reason in self.reasons],
        }
