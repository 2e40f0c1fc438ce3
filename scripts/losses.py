#!/usr/bin/env python
"""Fly one search and lose UAVs at each of many drawn instants of it: `python scripts/losses.py SEED 20`.

At each instant the process forks: the copy loses drawn UAVs (crash, mute, or program stopped) and flies on for 17 s, so
the flight until a loss is flown once for all of them. `25x2` loses two at once, 25 times, `10x5@15` five one after the
other, 15 s apart, and `8!` flies to the end; these may stand together. One JSON line for each copy:

    heal_s     of each loss: until the others were one network again, by their true positions ten times a second; 0:
               never apart
    connected  the share of the time since the first loss in which they were
    bounds_s   from the last loss until the last report whose bound was not stated, or left out somebody who lives; over
               channels that lose frames likely delays count
    bounded    the share of the reports born from 3 s after the healing on, within 17 s of the loss, whose bound was in
               force, and of those born meanwhile in the flight without the loss
    apart_anyway_s   how long all were apart meanwhile in the flight without the loss
    broken     bounds stated later than 4 s after the last loss, once healed, and not kept at somebody who lives
    curve      of losses one after the other, at the next one: lost, connected since the one before, covered, found

and, of copies that fly to the end, how many were found, by phone or as persons, when 95 % of the area were covered, the
least distance of two UAVs, the share of reports delivered of what an ideal flood could have delivered, contacts, all
stretches in which the others were apart, and when the broken bounds were stated. With `--without` the flight itself, in
which nobody is lost, has a line, too. `--scenario NAME` and `--set KEY=VALUE` fly others. The tables of
`docs/results/losses.md` are made of these lines, in `docs/results/data/losses.jsonl` (`scripts/tables losses flown-on
losses-in-a-row`).
"""

import argparse
import json
import os
import random
import re
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from fanet_mw.bus.messages import Message, Poses  # noqa: E402  (the tree's root is on the path now)
from fanet_mw.bus.radio_control import Control, Cut, Mishap, MishapKind, node_label  # noqa: E402
from fanet_mw.bus.topics import Topics  # noqa: E402
from fanet_mw.hosts.virtual import VirtualHost  # noqa: E402
from fanet_mw.scenario import Scenario  # noqa: E402
from fanet_mw.scenario.config import build  # noqa: E402
from fanet_mw.trace import BoundExcludes, BoundStated, Confirmed, Delivered, Generated, LikelyStated, Refuted  # noqa: E402
from fanet_mw.units import STILL, NodeId, S  # noqa: E402
from sim.records.record_kinds import records_of  # noqa: E402
from sim.records.trace_log import TraceLog  # noqa: E402
from sim.results.bounds import UNNOTICED_NS  # noqa: E402
from sim.results.clocks import true_delays  # noqa: E402
from sim.results.files import finish  # noqa: E402
from sim.results.links_over_time import parts  # noqa: E402
from sim.results.mission import Confirmations, CoveredCells  # noqa: E402
from sim.results.outcome import Outcome  # noqa: E402
from sim.run.virtual import (  # noqa: E402
    GARBAGE,
    StoppableUav,
    actors_of,
)
from sim.scenarios.catalog import find  # noqa: E402
from sim.world.environment.survivors import place  # noqa: E402

_KINDS: Final = ("crash", "mute", "stop")
_FROM_S: Final = 30.0
_UNTIL: Final = 0.8
"""The share of the flight after which nobody is lost any more."""
_BEGINS_S: Final = 15.0
"""A stretch apart is one of the loss if it begins within this time of it."""
_APART_S: Final = 0.5
"""Stretches with less time between them are one."""
_WINDOW_S: Final = 17.0
"""So long after a loss bounds are looked at."""
_AGAIN_S: Final = 3.0
"""So long after the others have healed bounds should be stated again."""


class Loss(NamedTuple):
    """One UAV that is lost."""

    at_s: float
    kind: str
    node: int

    @property
    def at_ns(self) -> int:
        return round(self.at_s * S)


class Copies(NamedTuple):
    """Copies of a flight that are asked for."""

    count: int
    at_once: int
    every_s: float | None
    to_end: bool

    @classmethod
    def of(cls, asked: str) -> "Copies":
        found = re.fullmatch(r"(\d+)(?:x(\d+)(?:@([\d.]+))?)?(!?)", asked)
        if found is None:
            raise argparse.ArgumentTypeError(
                f"{asked}: must be COUNT, COUNTxLOSSES or COUNTxLOSSES@SECONDS, ! after it"
            )
        return cls(int(found[1]), int(found[2] or 1), float(found[3]) if found[3] else None, bool(found[4]))


class Copy(NamedTuple):
    """One copy: who is lost when."""

    losses: list[Loss]
    every_s: float | None
    to_end: bool


class Instant(NamedTuple):
    """Where all UAVs are; a post on the ground, whose antenna reaches farther, is not looked at."""

    t_ns: int
    ids: npt.NDArray[np.int64]
    at: npt.NDArray[np.float64]


class Flight:
    """One flight, and what is kept of it."""

    def __init__(self, scenario: Scenario) -> None:
        tree = scenario.model_dump(mode="json", exclude_none=True)
        far = {"kind": "stop", "at_s": 10 * scenario.duration_s}
        self.scenario = build({**tree, "faults": [*tree["faults"], *({**far, "node": n} for n in scenario.uav_ids)]})
        self._topics, self._instants = Topics(scenario.name), list[Instant]()
        self._records = TraceLog(most_in_memory=sys.maxsize)  # copies must not write into one file
        self._actors = actors_of(self.scenario, scenario.name)
        self.host = VirtualHost(
            self._actors, on_records=self._records.extend, listeners=[(self._topics.pose, self._see)]
        )
        self.host.start()

    def _see(self, _: str, message: Message) -> None:
        if isinstance(message, Poses):
            ids, at = np.array(message.ids), np.array(message.states).reshape(-1, 6)[:, :3]
            flies = ids != (self.scenario.post or 0)
            self._instants.append(Instant(message.t_ns, ids[flies], at[flies]))

    def lose(self, kind: str, node: int) -> None:
        """A UAV is lost now."""
        label, lost = node_label(node), NodeId(node)
        what: Control = Cut(label, lost, 0, hears=True)
        if kind != "mute":
            what = Mishap(label, lost, MishapKind.CRASH if kind == "crash" else MishapKind.STOP, STILL, 0)
        self.host.put(self._topics.radio_control, what)
        uav = next(actor for actor in self._actors if actor.name == f"agent-{node}")
        if kind == "stop" and isinstance(uav, StoppableUav):
            uav.end_at(self.host.now_ns)
            self.host.nudge(uav)

    def torn(self, losses: Sequence[Loss], *, from_ns: int) -> list[tuple[int, bool]]:
        """The instants since one of them, and whether those who live then are apart."""
        found = []
        for t_ns, ids, at in self._instants:
            if t_ns < from_ns:
                continue
            lives = ~np.isin(ids, [loss.node for loss in losses if loss.at_ns <= t_ns])
            near = np.linalg.norm(at[lives, None] - at[None, lives], axis=2) <= self.scenario.radio.range_m
            found.append((t_ns, bool(parts(near).any())))
        return found

    def bounds(self, lost: set[int], *, from_ns: int, to_ns: int) -> tuple[list[int], list[int]]:
        """The births of the reports of those who live whose bound is in force for all of them, and of the others."""
        stated = {(one.node, one.seq) for one in records_of(self._records, BoundStated, LikelyStated)}
        short = {(one.node, one.seq) for one in records_of(self._records, BoundExcludes) if one.other not in lost}
        with_bound, without = list[int](), list[int]()
        for one in records_of(self._records, Generated):
            if from_ns <= one.t_ns <= to_ns and one.node not in lost:
                name = one.node, one.seq
                (with_bound if name in stated and name not in short else without).append(one.t_ns)
        return with_bound, without

    def broken(self, lost: set[int], from_ns: int) -> list[float]:
        """When the bounds that were not kept were stated, from an instant on [s]."""
        until: dict[tuple[int, int], tuple[int, set[int]]] = {}
        stated_s: dict[tuple[int, int], float] = {}
        lives = set(self.scenario.uav_ids) - lost
        for stated in records_of(self._records, BoundStated):
            if stated.t_ns >= from_ns and stated.t_ns + stated.bound_ns < self.host.now_ns and stated.node in lives:
                until[stated.node, stated.seq] = stated.bound_ns, lives - {stated.node}
                stated_s[stated.node, stated.seq] = round(stated.t_ns / S, 1)
        for one in records_of(self._records, BoundExcludes):
            if (one.node, one.seq) in until:
                until[one.node, one.seq][1].discard(one.other)
        for came in records_of(self._records, Delivered):
            due_ns, missing = until.get((came.origin, came.seq), (-1, set[int]()))
            if came.delay_ns <= due_ns:
                missing.discard(came.node)
        return sorted(stated_s[name] for name, (_, missing) in until.items() if missing)

    def curve(self, losses: Sequence[Loss], every_s: float, torn: Sequence[tuple[int, bool]]) -> list[list[float]]:
        """What is left so long after each loss: lost, connected since the one before, covered, found."""
        cells, rows, seen_ns = CoveredCells(self.scenario), list[list[float]](), -S
        found = Confirmations(place(self.scenario))
        news = iter([*records_of(self._records, Confirmed, Refuted)])
        waiting, ends = next(news, None), [(loss.at_ns, loss.at_ns + round(every_s * S)) for loss in losses]
        for t_ns, ids, at in self._instants:
            while len(rows) < len(ends) and t_ns > ends[len(rows)][1]:
                begin_ns, end_ns = ends[len(rows)]
                while waiting is not None and waiting.t_ns <= end_ns:
                    found.add(waiting)
                    waiting = next(news, None)
                apart = [is_torn for at_ns, is_torn in torn if begin_ns <= at_ns < end_ns]
                connected = round(1 - statistics.fmean(apart), 3)
                rows.append([len(rows) + 1, connected, round(cells.share, 3), len(found.found_ns())])
            if t_ns - seen_ns >= S:
                seen_ns = t_ns
                cells.add(at[~np.isin(ids, [loss.node for loss in losses if loss.at_ns <= t_ns])].tolist())
        return rows

    def summary(self) -> dict[str, Any]:
        records = true_delays(self._records) if self.scenario.clock.modelled else self._records
        reports = {actor.name: actor.report() for actor in self._actors}
        return finish(Outcome(self.scenario, "virtual", 0.0, records, reports), out=None)


def drawn(scenario: Scenario, asked: Copies) -> list[Copy]:
    """The copies that are asked for, with their losses."""
    draw, found = random.Random(f"losses {scenario.name} {scenario.seed} {asked.at_once}"), list[Copy]()
    every_s = asked.every_s or 0.0
    last_s = max(_FROM_S, _UNTIL * scenario.duration_s - (asked.at_once - 1) * every_s)
    for _ in range(asked.count):
        at_s = round(draw.uniform(_FROM_S, last_s), 1)
        nodes = draw.sample(list(scenario.uav_ids), asked.at_once)
        losses = [Loss(at_s + rank * every_s, draw.choice(_KINDS), node) for rank, node in enumerate(nodes)]
        found.append(Copy(losses, asked.every_s, asked.to_end))
    return found


def judged(flight: Flight, copy: Copy) -> dict[str, Any]:
    """What became of the others."""
    losses, every_s, to_end = copy
    lost, torn = {loss.node for loss in losses}, flight.torn(losses, from_ns=losses[0].at_ns)
    heal_s = []
    for rank, loss in enumerate(losses if every_s else losses[:1]):
        end_ns, until_ns = loss.at_ns, loss.at_ns + round(_BEGINS_S * S)
        if every_s and rank + 1 < len(losses):
            until_ns = min(until_ns, losses[rank + 1].at_ns - 1)  # what begins later is of the next one
        for t_ns, is_torn in torn:
            counts = t_ns <= until_ns or (end_ns > loss.at_ns and t_ns - end_ns <= _APART_S * S)
            if t_ns >= loss.at_ns and is_torn and counts:
                end_ns = t_ns + S // 10
        heal_s.append(round((end_ns - loss.at_ns) / S, 1))
    last_ns, window_ns = losses[-1].at_ns, losses[-1].at_ns + round(_WINDOW_S * S)
    _, without = flight.bounds(lost, from_ns=last_ns, to_ns=window_ns)
    again_ns = last_ns + round((heal_s[-1] + _AGAIN_S) * S)
    held, late = flight.bounds(lost, from_ns=again_ns, to_ns=window_ns)
    broken_s = flight.broken(lost, last_ns + max(UNNOTICED_NS, round(heal_s[-1] * S)))
    found: dict[str, Any] = {
        "scenario": flight.scenario.name, "seed": flight.scenario.seed, "losses": losses, "heal_s": heal_s,
        "connected": round(1 - statistics.fmean(is_torn for _, is_torn in torn), 3) if torn else None,
        "bounds_s": round((max(without, default=last_ns) - last_ns) / S, 1), "bounded": [_share(held, late)],
        "broken": len(broken_s),
    }  # fmt: skip
    if every_s:
        found["curve"] = flight.curve(losses, every_s, torn)
    if to_end:
        found |= outcome(flight) | {"apart": stretches(torn), "broken_s": broken_s}
    return found


def stretches(torn: Sequence[tuple[int, bool]]) -> list[list[float]]:
    """From when until when it was torn [s]."""
    found: list[list[float]] = []
    for t_ns, is_torn in torn:
        t_s = round(t_ns / S, 1)
        if is_torn and found and t_s - found[-1][1] <= _APART_S:
            found[-1][1] = t_s
        elif is_torn:
            found.append([t_s, t_s])
    return found


def outcome(flight: Flight) -> dict[str, Any]:
    """What a flight that has come to its end has achieved."""
    summary = flight.summary()
    mission, reached = summary["mission"], summary["reachable"]
    told = reached.get("report", next(iter(reached.values()), {"pdr": None}))
    return {
        "found": mission["persons"], "of": mission["survivors"], "covered": mission["coverage"],
        "pdr": told["pdr"], "contacts": mission["collisions"],
        "last_find_s": max(mission["time_to_confirm_s"], default=None), "covered_95_s": mission["covered_95_s"],
        "nearest_m": mission["nearest_m"]["least"],
    }  # fmt: skip


def without_a_loss(flight: Flight) -> dict[str, Any]:
    """The line of the flight in which nobody is lost."""
    torn = flight.torn([], from_ns=0)
    return {
        "scenario": flight.scenario.name, "seed": flight.scenario.seed, "losses": [], "heal_s": [],
        "connected": round(1 - statistics.fmean(is_torn for _, is_torn in torn), 3),
        "broken": len(flight.broken(set(), 0)),
    } | outcome(flight)  # fmt: skip


def _share(yes: Sequence[int], no: Sequence[int]) -> float | None:
    return round(len(yes) / (len(yes) + len(no)), 3) if yes or no else None


def fly(scenario: Scenario, copies: Sequence[Copy], *, without: bool = False) -> None:
    """Fly, and print a line for each copy, which are in the order of their losses; `without`: for the flight, too."""
    with GARBAGE.not_collected():
        flight, waiting = Flight(scenario), list[tuple[int, dict[str, Any]]]()
        end_ns = scenario.duration_ns
        for copy in copies:
            losses = copy.losses
            flight.host.run(losses[0].at_ns)
            _say(flight, waiting)
            read, write = os.pipe()
            if os.fork():
                os.close(write)
                with os.fdopen(read) as told:
                    line = told.read()
                os.wait()
                if line:  # else the copy failed, and has said why
                    waiting.append((min(end_ns, losses[-1].at_ns + round(_WINDOW_S * S)), json.loads(line)))
                    waiting.sort(key=_when)
                continue
            os.close(read)
            for loss in losses:
                flight.host.run(loss.at_ns)
                flight.lose(loss.kind, loss.node)
            over_ns = min(losses[-1].at_ns + round(_WINDOW_S * S), end_ns)
            flight.host.run(end_ns if copy.to_end else over_ns)
            with os.fdopen(write, "w") as told:
                json.dump(judged(flight, copy), told)
            os._exit(0)
        if waiting:
            flight.host.run(max(t_ns for t_ns, _ in waiting))
        _say(flight, waiting)
        if without:
            flight.host.run(end_ns)
            print(json.dumps(without_a_loss(flight)), flush=True)


def _first(copy: Copy) -> int:
    return copy.losses[0].at_ns


def _when(one: tuple[int, dict[str, Any]]) -> int:
    return one[0]


def _say(flight: Flight, waiting: list[tuple[int, dict[str, Any]]]) -> None:
    """Print what is known of the copies whose time is over in the flight itself, too."""
    while waiting and waiting[0][0] <= flight.host.now_ns:
        end_ns, found = waiting.pop(0)
        at_s, _, _ = found["losses"][-1]
        from_ns = round((at_s + found["heal_s"][-1] + _AGAIN_S) * S)
        same = flight.bounds({node for _, _, node in found["losses"]}, from_ns=from_ns, to_ns=end_ns)
        found["bounded"].append(_share(*same))
        torn = flight.torn([], from_ns=round(found["losses"][0][0] * S))
        found["apart_anyway_s"] = sum(is_torn for t_ns, is_torn in torn if t_ns <= end_ns) / 10
        print(json.dumps(found), flush=True)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seed", type=int)
    parser.add_argument("copies", nargs="+", type=Copies.of)
    parser.add_argument("--without", action="store_true", help="fly the flight without a loss to its end, too")
    parser.add_argument("--scenario", default="rescue")
    parser.add_argument("--set", action="append", default=[], dest="settings")
    asked = parser.parse_args(arguments)
    scenario = find(asked.scenario, ["traffic.interval_s=100000", *asked.settings, f"seed={asked.seed}"])
    copies = sorted((copy for each in asked.copies for copy in drawn(scenario, each)), key=_first)
    fly(scenario, copies, without=asked.without)


if __name__ == "__main__":
    main()
