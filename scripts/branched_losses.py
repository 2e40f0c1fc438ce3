#!/usr/bin/env python
"""Fly one search and lose a UAV at each of many drawn instants of it: `python scripts/branched_losses.py SEED COUNT`.

At each instant the process forks: the copy loses the drawn UAV (crash, mute, or program stopped) and flies on for
`--after` seconds, so the flight until a loss is flown once for all of them. One JSON line for each loss:

    heal_s     until the others were one network again, by their true positions ten times a second; 0: never apart
    bounds_s   until the last report whose bound was not stated, or left out somebody who lives; 0: there was none

`--scenario NAME` and `--set KEY=VALUE` fly others. With `--of FILE` it sums up the lines of a file instead.
"""

import argparse
import json
import os
import random
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from fanet_mw.bus.messages import Message, Poses  # noqa: E402  (the tree's root is on the path now)
from fanet_mw.bus.radio_control import Control, Cut, Mishap, MishapKind, node_label  # noqa: E402
from fanet_mw.bus.topics import Topics  # noqa: E402
from fanet_mw.hosts.virtual import VirtualHost  # noqa: E402
from fanet_mw.scenario import Scenario  # noqa: E402
from fanet_mw.scenario.config import build  # noqa: E402
from fanet_mw.trace import BoundExcludes, BoundStated, Generated, Record  # noqa: E402
from fanet_mw.units import STILL, NodeId, S  # noqa: E402
from sim.results.coherence import coherence  # noqa: E402
from sim.run.stoppable_uav import StoppableUav  # noqa: E402
from sim.run.virtual import actors_of  # noqa: E402
from sim.scenarios.catalog import find  # noqa: E402

_KINDS: Final = ("crash", "mute", "stop")
_FROM_S: Final = 30.0
_UNTIL: Final = 0.8
"""The share of the flight after which nobody is lost any more."""
_BEGINS_S: Final = 15.0
"""A stretch apart is one of the loss if it begins within this time of it."""
_APART_S: Final = 0.5
"""Stretches with less time between them are one."""


class Flight:
    """One flight, and what is kept of it."""

    def __init__(self, scenario: Scenario) -> None:
        tree = scenario.model_dump(mode="json", exclude_none=True)
        far = {"kind": "stop", "at_s": 10 * scenario.duration_s}
        self.scenario = build({**tree, "faults": [*tree["faults"], *({**far, "node": n} for n in scenario.uav_ids)]})
        self.topics, self.poses, self.records = Topics(scenario.name), list[Poses](), list[Record]()
        self.actors = actors_of(self.scenario, scenario.name)
        self.host = VirtualHost(self.actors, on_records=self._take, listeners=[(self.topics.pose, self._see)])
        self.host.start()

    def _see(self, _: str, message: Message) -> None:
        if isinstance(message, Poses):
            self.poses.append(message)

    def _take(self, records: list[Record]) -> None:
        self.records += [one for one in records if isinstance(one, BoundStated | BoundExcludes | Generated)]

    def lose(self, kind: str, node: int) -> None:
        """A UAV is lost now."""
        label, lost = node_label(node), NodeId(node)
        what: Control = Cut(label, lost, 0, hears=True)
        if kind != "mute":
            what = Mishap(label, lost, MishapKind.CRASH if kind == "crash" else MishapKind.STOP, STILL, 0)
        self.host.put(self.topics.radio_control, what)
        uav = next(actor for actor in self.actors if actor.name == f"agent-{node}")
        if kind == "stop" and isinstance(uav, StoppableUav):
            uav.end_at(self.host.now_ns)
            self.host.nudge(uav)

    def heal_s(self, node: int, at_ns: int) -> float:
        """How long after a loss the others were one network again."""
        end_ns = at_ns
        for poses in self.poses:
            counts = poses.t_ns - at_ns <= _BEGINS_S * S or poses.t_ns - end_ns <= _APART_S * S
            if poses.t_ns < at_ns or not counts:
                continue
            at = np.array(poses.states).reshape(-1, 6)[np.array(poses.ids) != node, :3]
            near = np.linalg.norm(at[:, None] - at[None], axis=2) <= self.scenario.radio.range_m
            if not coherence(near).connected:
                end_ns = poses.t_ns + S // 10
        return (end_ns - at_ns) / S

    def bounds_s(self, node: int, at_ns: int) -> float:
        """How long after a loss the last report was born whose bound is not in force for all who live."""
        stated, without = set[tuple[int, int]](), set[tuple[int, int]]()
        for one in self.records:
            if isinstance(one, BoundStated):
                stated.add((one.node, one.seq))
            elif isinstance(one, BoundExcludes) and one.other != node:
                without.add((one.node, one.seq))
        born = [
            one.t_ns
            for one in self.records
            if isinstance(one, Generated) and one.t_ns >= at_ns and one.node != node
            if (one.node, one.seq) not in stated or (one.node, one.seq) in without
        ]
        return (max(born, default=at_ns) - at_ns) / S


def losses(scenario: Scenario, count: int, *, after_s: float) -> None:
    """Fly, and print a line for each of so many losses."""
    draw, flight = random.Random(f"losses {scenario.name} {scenario.seed}"), Flight(scenario)
    drawn = sorted(
        (
            round(draw.uniform(_FROM_S, _UNTIL * scenario.duration_s), 1),
            draw.choice(list(scenario.uav_ids)),
            draw.choice(_KINDS),
        )
        for _ in range(count)
    )
    for at_s, node, kind in drawn:
        at_ns = round(at_s * S)
        flight.host.run(at_ns)
        sys.stdout.flush()
        child = os.fork()
        if child:
            os.waitpid(child, 0)
            continue
        flight.lose(kind, node)
        flight.host.run(min(at_ns + round(after_s * S), scenario.duration_ns))
        found: dict[str, Any] = {"scenario": scenario.name, "seed": scenario.seed, "at_s": at_s, "kind": kind}
        found |= {"node": node, "heal_s": round(flight.heal_s(node, at_ns), 1)}
        found["bounds_s"] = round(flight.bounds_s(node, at_ns), 1)
        print(json.dumps(found), flush=True)
        os._exit(0)


def summed(lines: Sequence[str]) -> str:
    """What so many losses came to, in one sentence."""
    found = [json.loads(line) for line in lines]
    heal = [one["heal_s"] for one in found]
    again = sum(one["bounds_s"] <= one["heal_s"] + 3 for one in found)
    return (
        f"{len(heal)} losses in {len({(one['scenario'], one['seed']) for one in found})} flights: one network again "
        f"within 15 s after {sum(one <= 15 for one in heal)}, median {statistics.median(heal):.1f} s, worst "
        f"{max(heal):.1f} s, never apart {sum(not one for one in heal)}; bounds in force again within 3 s of that "
        f"after {again}"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seed", nargs="?", type=int)
    parser.add_argument("count", nargs="?", type=int, default=20)
    parser.add_argument("--scenario", default="rescue")
    parser.add_argument("--set", action="append", default=[], dest="settings")
    parser.add_argument("--after", type=float, default=17.0)
    parser.add_argument("--of", type=Path)
    asked = parser.parse_args(arguments)
    if asked.of is not None:
        print(summed(asked.of.read_text().splitlines()))
    else:
        settings = ["traffic.interval_s=100000", *asked.settings, f"seed={asked.seed}"]
        losses(find(asked.scenario, settings), asked.count, after_s=asked.after)


if __name__ == "__main__":
    main()
