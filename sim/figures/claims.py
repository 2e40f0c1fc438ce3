"""What the paper claims of a figure, and the verdict: both are code over the table of a sweep.

A claim is one or more statements. A statement is a quantity with one value per seed, and the side of a threshold on
which the claim has it. It holds when the whole 95 % interval of its mean is on that side, fails when the whole interval
is on the other, and is open when the threshold lies within. A claim agrees when all its statements hold, differs when
all fail, and is partly so otherwise.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Literal

from sim.figures.statistics import Interval, interval


class Verdict(StrEnum):
    """Of a claim."""

    AGREES = "agrees"
    PARTLY = "partly"
    DIFFERS = "differs"


class Finding(StrEnum):
    """Of a statement."""

    HOLDS = "holds"
    FAILS = "fails"
    OPEN = "open"


@dataclass(frozen=True, slots=True)
class Statement:
    """A quantity, one value per seed, and where the claim has it."""

    what: str
    values: Sequence[float]
    side: Literal["above", "below"]
    threshold: float
    unit: str = ""

    @property
    def interval(self) -> Interval:
        return interval(self.values)

    @property
    def finding(self) -> Finding:
        found = self.interval
        below, above = found.high <= self.threshold, found.low > self.threshold
        if not (below or above):
            return Finding.OPEN
        return Finding.HOLDS if above == (self.side == "above") else Finding.FAILS

    def text(self) -> str:
        """For people, with the figures."""
        bound = f"{self.side} {self.threshold:g}{f' {self.unit}' if self.unit else ''}"
        return f"{self.what}: {self.interval.text(self.unit)}, claimed {bound}: {self.finding}"


@dataclass(frozen=True, slots=True)
class Claim:
    """One sentence of the paper, and what decides over it."""

    figure: int
    claim: str
    """What the paper says."""
    statements: Sequence[Statement]
    why: str = ""
    """What makes the difference, or why it is so: an experiment of this sweep, or a mechanism with its place."""

    @property
    def verdict(self) -> Verdict:
        findings = {statement.finding for statement in self.statements}
        if findings == {Finding.HOLDS}:
            return Verdict.AGREES
        return Verdict.DIFFERS if findings == {Finding.FAILS} else Verdict.PARTLY

    def plain(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return {
            "figure": self.figure,
            "claim": self.claim,
            "verdict": self.verdict.value,
            "why": self.why,
            "statements": [
                {
                    "what": statement.what,
                    "mean": statement.interval.mean,
                    "low": statement.interval.low,
                    "high": statement.interval.high,
                    "seeds": statement.interval.runs,
                    "side": statement.side,
                    "threshold": statement.threshold,
                    "unit": statement.unit,
                    "finding": statement.finding.value,
                    "text": statement.text(),
                }
                for statement in self.statements
            ],
        }
