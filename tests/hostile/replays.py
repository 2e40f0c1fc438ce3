"""A foreign station repeats, byte for byte and later, what it heard: no clock follows it, and nearly all arrives.

    python tests/hostile/replays.py [SECONDS [SCENARIO]]    fly what is missing of the matrix, for so long at most

The station takes the place of a node. The matrix has each scenario with five seeds, both places (corner and middle),
every kind of frame and both addresses (the station's own, or that of whom it repeats); the delays of 0.2 to 60 s go
round. Unless nearly all arrives and all clocks agree, a run is compared with the same one in which the station is
silent; where less arrives than is promised, also with one in which it sends nonsense of the same lengths at the same
instants: whoever sends takes airtime from others, and no check of a node gives it back. What was flown is kept
(`docs/results/data/replays.jsonl`), and `scripts/tables replays` writes the table of it.
"""

import contextlib
import itertools
import json
import math
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, Final, NamedTuple

from fanet_mw import wire
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, Reception, TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import MalformedFrameError
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.node.reader import packet_of
from fanet_mw.scenario import Scenario
from fanet_mw.trace import ClockSampled
from fanet_mw.units import BROADCAST, US, NodeId, S
from fanet_mw.wire import Kind
from sim.records.record_kinds import records_of
from sim.records.trace_log import TraceLog
from sim.results.clocks import errors_ns, true_delays
from sim.results.metrics import summarize
from sim.results.outcome import Outcome
from sim.run.virtual import actors_of
from sim.scenarios import catalog

CLOCKS: Final = ("clock.sync=beacons", "clock.offset_ms=5", "clock.drift_ppm=20")
SCENARIOS: Final[Mapping[str, tuple[str, ...]]] = {
    "clusters": ("nodes.count=15", "clusters.count=14", "clusters.turn_slack_us=400", "warmup_s=26"),
    "rescue": ("warmup_s=24",),
    "rescue of 20": ("world.area_m=1100", "nodes.count=20", "warmup_s=20"),
}
NODES: Final = {"clusters": 15, "rescue": 45, "rescue of 20": 20}
PLACES: Final = {
    "clusters": {"corner": 15, "middle": 8},
    "rescue": {"corner": 45, "middle": 23},
    "rescue of 20": {"corner": 20, "middle": 8},
}
DELAYS_S: Final = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 60.0)
REPEATING_S: Final = 12
"""How long data of the longest delay are repeated: they begin after the warm-up."""
KINDS: Final[Mapping[str, tuple[Kind, ...]]] = {
    "clusters": (Kind.HELLO, Kind.DATA, Kind.JOIN, Kind.SCHEDULE),
    "rescue": (Kind.HELLO, Kind.DATA, Kind.ROUND),
    "rescue of 20": (Kind.HELLO, Kind.DATA, Kind.ROUND),
}
"""The kinds of frames of the protocol of each scenario."""
SEEDS: Final = range(1, 6)
KEPT: Final = Path(__file__).parents[2] / "docs" / "results" / "data" / "replays.jsonl"
_NEAR_US: Final = 100
LEAST_SHARE: Final = 0.99
"""Of what arrives without the station."""


class Attack(NamedTuple):
    """What the station does."""

    scenario: str
    seed: int
    place: str
    kind: Kind
    spoofed: bool
    delay_s: float

    @property
    def station(self) -> NodeId:
        return NodeId(PLACES[self.scenario][self.place])

    def __str__(self) -> str:
        who = "under the address of whom it repeats" if self.spoofed else "under its own address"
        return (
            f"{self.scenario} seed {self.seed}, {self.place}: {self.kind.name.lower()} repeated {self.delay_s:g} s "
            f"later {who}"
        )


class Repeater(Actor):
    """Hears everything at the place of one node, and repeats each frame of some kinds later, or nonsense instead."""

    def __init__(
        self, node: NodeId, swarm: str, *, kinds: frozenset[Kind], delay_ns: int, nonsense: bool = False
    ) -> None:
        topics = Topics(swarm)
        super().__init__(f"agent-{node}", (topics.radio_rx(node),))
        self._node, self._topic = node, topics.radio_tx(node)
        self._kinds, self._delay_ns, self._nonsense = kinds, delay_ns, nonsense
        self.sent = self._heard = 0
        self._waiting: list[tuple[int, bytes]] = []
        self._random = Random("nonsense")

    def start(self, now_ns: int) -> None:
        """Nothing is prepared."""

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        if isinstance(message, Reception):
            self._heard += 1
            if wire.peek_kind(message.frame) in self._kinds:
                self._waiting.append((message.end_ns + self._delay_ns, message.frame))

    def next_wake_ns(self) -> int | None:
        return self._waiting[0][0] if self._waiting else None

    def wake(self, now_ns: int) -> None:
        while self._waiting and self._waiting[0][0] <= now_ns:
            frame = self._waiting.pop(0)[1]
            if self._nonsense:
                frame = self._random.randbytes(len(frame))
            self.outbox.append((self._topic, TxRequest(self.sent, now_ns, frame, BROADCAST, wants_status=False)))
            self.sent += 1

    def report(self) -> Mapping[str, Any]:
        own = {"kind": "agent", "node": self._node, "generated": 0, "bus_malformed": 0}
        return {**own, "frames_sent": self.sent, "receptions": self._heard, "dropped": {}}


class Seen(NamedTuple):
    """What became of a run, as the other nodes saw it."""

    summary: Mapping[str, Any]
    reports: Mapping[str, Mapping[str, Any]]
    sent: int
    """The frames that the station has sent."""
    apart_ns: int
    """The greatest difference between two clocks that state an error after the warm-up."""
    beyond: int
    """The samples of clocks whose true error was beyond the stated one."""

    def refused(self) -> Counter[str]:
        found: Counter[str] = Counter()
        for report in self.reports.values():
            found.update({why: report.get("clock", {}).get(why, 0) for why in ("old", "relayed", "repeated")})
            found.update(report.get("dropped", {}))
            found["copies"] += report.get("duplicates", 0)
        return +found


def scenario_of(attack: Attack, *more: str) -> Scenario:
    name = attack.scenario
    fair = [node for node in range(1, NODES[name] + 1) if node != attack.station]
    keys = SCENARIOS[name]
    warmup_s = int(keys[-1].partition("=")[2])
    longest_s = max(DELAYS_S[-2:] if attack.delay_s > DELAYS_S[-2] else DELAYS_S[:-1])
    seconds = warmup_s + REPEATING_S + (longest_s + 2 if name == "clusters" else attack.delay_s + 7)
    return catalog.find(name.partition(" ")[0], [
        *CLOCKS, *keys, f"duration_s={seconds:g}", f"traffic.targets={fair}", f"traffic.sources={fair[1:]}",
        *more, f"seed={attack.seed}",
    ])  # fmt: skip


def run(attack: Attack, *more: str, silent: bool = False, nonsense: bool = False) -> Seen:
    """Fly once with the station in the place of its node."""
    scenario = scenario_of(attack, *more)
    kinds = frozenset(() if silent else (attack.kind,))
    delay_ns = round(attack.delay_s * S)
    repeater = Repeater(attack.station, scenario.name, kinds=kinds, delay_ns=delay_ns, nonsense=nonsense)
    actors = [repeater if actor.name == repeater.name else actor for actor in actors_of(scenario, scenario.name)]
    for actor in actors:
        if attack.spoofed and actor.name.startswith("agent-") and actor is not repeater:
            actor.receive = _heard_from_its_transmitter(actor, attack.station)  # type: ignore[method-assign]
    records = TraceLog(None)
    host = VirtualHost(actors, on_records=records.extend)
    host.start()
    for second in range(1, math.ceil(scenario.duration_s) + 1):
        host.run(min(second * S, scenario.duration_ns))
    host.stop()
    reports = {actor.name: actor.report() for actor in actors}
    outcome = Outcome(scenario=scenario, mode="virtual", wall_s=0.0, records=true_delays(records), reports=reports)
    start_ns, _ = scenario.traffic_window_ns
    samples = [one for one in records_of(outcome.records, ClockSampled) if one.t_ns >= start_ns]
    ahead: dict[int, list[int]] = defaultdict(list)
    for sample in samples:
        if sample.bound_ns >= 0:
            ahead[sample.t_ns].append(sample.ahead_ns)
    apart_ns = max((max(values) - min(values) for values in ahead.values()), default=0)
    beyond = sum(abs(error_ns) > sample.bound_ns >= 0 for sample, error_ns in errors_ns(samples))
    fair = {name: report for name, report in reports.items() if name.startswith("agent-") and name != repeater.name}
    return Seen(summarize(outcome, trace_sha256=""), fair, repeater.sent, apart_ns, beyond)


def _heard_from_its_transmitter(actor: Actor, station: NodeId) -> Any:
    """The station also forges the address of its radio: it transmits under that of whom it repeats."""
    receive = actor.receive

    def received(topic: str, message: Message, now_ns: int) -> None:
        if isinstance(message, Reception) and message.src == station:
            with contextlib.suppress(MalformedFrameError):  # nonsense has no transmitter
                message = message._replace(src=NodeId(packet_of(message.frame).header.prev_hop))
        receive(topic, message, now_ns)

    return received


@cache
def _silent(attack: Attack) -> Seen:
    return run(attack, silent=True)


def silent(attack: Attack) -> Seen:
    """The same run with a station that only listens; computed once for all that differ in nothing else."""
    delay_s = max(20.0, attack.delay_s) if attack.scenario == "clusters" else attack.delay_s
    return _silent(attack._replace(kind=Kind.HELLO, spoofed=False, delay_s=delay_s))


def matrix() -> list[Attack]:
    """All runs, in an order in which the first ones already have something of everything."""
    delays = itertools.cycle(DELAYS_S)
    large = [
        Attack(scenario, seed, place, kind, spoofed, next(delays))
        for seed in SEEDS
        for scenario in ("clusters", "rescue")
        for kind in KINDS[scenario]
        for place in ("corner", "middle")
        for spoofed in (False, True)
    ]
    return [*large, *(one._replace(scenario="rescue of 20") for one in large if one.scenario == "rescue")]


class Verdict(NamedTuple):
    """What became of one run, beside the one without the station."""

    attack: Attack
    sent: int
    share: float
    """What arrived of what arrives without the station, or of everything if that was not flown."""
    noise_share: float | None
    """The same with nonsense of the same lengths; None if that was not flown."""
    apart_us: float
    apart_without_us: float | None
    beyond: int
    """The samples of clocks whose true error was beyond the stated one, above those without the station."""
    refused: Mapping[str, int]

    @property
    def kept(self) -> bool:
        """True if clocks and deliveries are those without the station, or else those beside as much nonsense."""
        least = LEAST_SHARE if self.noise_share is None else min(LEAST_SHARE, 0.995 * self.noise_share)
        return (
            self.beyond <= 0 and self.apart_us < max(2 * (self.apart_without_us or 0), _NEAR_US) and self.share >= least
        )

    def __str__(self) -> str:
        beside = "" if self.noise_share is None else f", {self.noise_share:.4f} with nonsense"
        without = "" if self.apart_without_us is None else f" (without {self.apart_without_us:.0f})"
        refused = ", ".join(f"{count} {why}" for why, count in sorted(self.refused.items()))
        return (
            f"{self.attack}: {self.sent} sent, {self.share:.4f} of what arrives without{beside}, clocks apart "
            f"{self.apart_us:.0f} us{without}, {self.beyond} beyond their error; "
            f"{refused}: {'kept' if self.kept else 'NOT KEPT'}"
        )


def judged(attack: Attack) -> Verdict:
    """Fly it; without the station, too, unless it was harmless for certain, and with nonsense if too little arrives."""
    seen = run(attack)
    pdr, refused = seen.summary["pdr"], dict(sorted(seen.refused().items()))
    if pdr >= LEAST_SHARE and seen.apart_ns < _NEAR_US * US and not seen.beyond:
        return Verdict(attack, seen.sent, round(pdr, 4), None, round(seen.apart_ns / US, 1), None, 0, refused)
    without = silent(attack)
    share = pdr / without.summary["pdr"]
    noise = run(attack, nonsense=True).summary["pdr"] / without.summary["pdr"] if share < LEAST_SHARE else None
    return Verdict(
        attack, seen.sent, round(share, 4), noise and round(noise, 4), round(seen.apart_ns / US, 1),
        round(without.apart_ns / US, 1), seen.beyond - without.beyond, refused,
    )  # fmt: skip


def kept() -> dict[Attack, Verdict]:
    """What was flown."""
    found = {}
    for line in KEPT.read_text(encoding="utf-8").splitlines() if KEPT.exists() else ():
        *attack, kind = json.loads(line)["attack"]
        key = Attack(*attack[:3], Kind[kind], *attack[3:])
        found[key] = Verdict(key, **json.loads(line)["seen"])
    return found


def keep(verdicts: Mapping[Attack, Verdict]) -> None:
    """Write what was flown, in the order of the matrix."""
    lines = []
    for attack in matrix():
        if attack in verdicts:
            scenario, seed, place, kind, spoofed, delay_s = attack
            seen = {name: value for name, value in verdicts[attack]._asdict().items() if name != "attack"}
            lines.append(json.dumps({"attack": [scenario, seed, place, spoofed, delay_s, kind.name], "seen": seen}))
    KEPT.write_text("".join(line + "\n" for line in lines), encoding="utf-8")


def main() -> int:
    until_s = time.monotonic() + (float(sys.argv[1]) if len(sys.argv) > 1 else math.inf)
    verdicts = kept()
    for attack in matrix():
        if attack in verdicts or attack.scenario not in (sys.argv[2:3] or SCENARIOS):
            continue
        if time.monotonic() > until_s:
            break
        verdicts[attack] = judged(attack)
        keep(kept() | {attack: verdicts[attack]})
        print(verdicts[attack], flush=True)
    missing = len(matrix()) - len(verdicts)
    wrong = sum(not verdict.kept for verdict in verdicts.values())
    print(f"{len(verdicts)} runs, {wrong} not kept, {missing} not flown")
    return min(wrong, 1)


if __name__ == "__main__":
    sys.exit(main())
