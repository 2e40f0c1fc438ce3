"""Formation flight by clusters in `convoy`: distances and gaps, before, while and after one UAV is cut off."""

import math
from collections.abc import Collection, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from fanet_mw.scenario import Scenario
from fanet_mw.trace import Collided, Posed, Record, RoleChanged
from fanet_mw.units import S
from sim.run.virtual import simulate
from sim.scenarios import catalog
from tests.tables.markdown import Rows

_SEEDS: Final = (1, 2, 3)
_SETTLED_S: Final = 25
"""How long after a change the formation is looked at again."""


class Instant(NamedTuple):
    """One second of a run."""

    t_s: float
    to_head_m: list[float]
    """Of each UAV in reach of others that follows a head in its own cluster."""
    gaps: list[float]
    """The widest gap on the circle around each head, as a multiple of an even one."""
    heads_m: list[float]
    """The distances of the other heads from the leader."""


def measured() -> Rows:
    """The table of docs/explanation/formation-flight.md."""
    flown = [_flown(catalog.find("convoy", [f"seed={seed}"])) for seed in _SEEDS]
    scenario = catalog.find("convoy")
    (fault,) = scenario.faults
    lost_s, back_s = fault.at_s, fault.at_s + (getattr(fault, "for_s", None) or 0.0)
    phases = {
        "all 21 fly": (scenario.warmup_s + 3 * _SETTLED_S, lost_s),
        "one is cut off, first 10 s": (lost_s + 3, lost_s + 10),
        "one is cut off, later": (lost_s + _SETTLED_S, back_s),
        "it is back": (back_s + 2 * _SETTLED_S, scenario.duration_s),
    }
    contacts = sum(found for _, found in flown)
    instants = [instant for found, _ in flown for instant in found]
    rows = [
        ["", "from [s]", "to [s]", "distance to the head [m]: 1 %", "median", "99 %",
         "widest gap over an even one, worst cluster: median", "heads from the leader [m]: 1 %", "99 %", "contacts"]
    ]  # fmt: skip
    for name, (from_s, to_s) in phases.items():
        within = [instant for instant in instants if from_s <= instant.t_s <= to_s]
        to_head = np.concatenate([instant.to_head_m for instant in within])
        heads = np.concatenate([instant.heads_m for instant in within])
        widest = [max(instant.gaps) for instant in within]
        rows.append(
            [name, f"{from_s:.0f}", f"{to_s:.0f}", *(f"{q:.0f}" for q in np.quantile(to_head, (0.01, 0.5, 0.99))),
             f"{np.median(widest):.2f}", *(f"{q:.0f}" for q in np.quantile(heads, (0.01, 0.99))), str(contacts)]
        )  # fmt: skip
    return rows


def _flown(scenario: Scenario) -> tuple[list[Instant], int]:
    """The seconds of one run, and the contacts in it."""
    records = simulate(scenario).records
    return list(_instants(records)), sum(1 for record in records if type(record) is Collided)


def _instants(records: Collection[Record]) -> Iterator[Instant]:
    head_of: dict[int, int] = {}
    at: dict[int, tuple[float, float]] = {}
    t_ns = 0
    for record in sorted((r for r in records if type(r) in (Posed, RoleChanged)), key=lambda record: record.t_ns):
        if type(record) is RoleChanged:
            head_of[record.node] = record.head
        elif type(record) is Posed:
            if record.t_ns != t_ns and at and head_of:
                yield _instant(t_ns / S, at, head_of)
            t_ns = record.t_ns
            at[record.node] = (record.east_m, record.north_m)


def _instant(t_s: float, at: dict[int, tuple[float, float]], head_of: dict[int, int]) -> Instant:
    members: dict[int, list[int]] = {head: [] for head in set(head_of.values()) - {0}}
    for node in sorted(at):
        head = head_of.get(node, 0) or min(members, key=lambda one: math.dist(at[node], at[one]))
        if node != head:
            members[head].append(node)
    heads = sorted(head for head, others in members.items() if others)
    return Instant(
        t_s,
        [math.dist(at[node], at[head]) for head in heads for node in members[head]],
        [_widest(at[head], [at[node] for node in members[head]]) for head in heads],
        [math.dist(at[heads[0]], at[head]) for head in heads[1:]],
    )


def _widest(middle: tuple[float, float], places: Sequence[tuple[float, float]]) -> float:
    bearings = sorted(math.degrees(math.atan2(east - middle[0], north - middle[1])) for east, north in places)
    widest = max((b - a) % 360 or 360.0 for a, b in zip(bearings, [*bearings[1:], bearings[0]], strict=True))
    return widest * len(bearings) / 360
