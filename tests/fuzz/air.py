"""Whole swarms, one node of which sends near misses of what it hears: in virtual time, over all protocols.

    what the others transmit -> the fuzzer's station hears it -> one thing changed, all checksums right -> on the air

Promised: nothing raises, nobody is woken without end, every frame is accounted for, memory does not grow, and the same
seed gives the same run. `air.py [RUNS [FIRST_SEED [PROCESSES]]]` is the long run, round the swarms of `corpus`.
"""

import os
import resource
import sys
import time
import traceback
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from random import Random
from typing import Any, Final, NamedTuple

import corpus
import mutations

from emulator.compile_kernel import warm_up
from fanet_mw import wire
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, Reception, TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import MalformedFrameError
from fanet_mw.rng import stream
from fanet_mw.units import BROADCAST, MS, US, NodeId

sys.path.append(str(Path(__file__).parents[1] / "integration"))
import scenario_draws

EVIL: Final = NodeId(5)
"""In the middle of nine: four hear it, and it hears them."""
MOST_MB: Final = 400
"""By how much one run may raise the peak of the process that runs it."""
_KEPT: Final = 40
"""Frames of a kind that are remembered to be changed later; kinds are picked alike, however often they are heard."""
_CONTROL_TYPE_AT: Final = wire.HEADER_BYTES + 11
"""Where a rival's control packet has the type of its message."""


class Fuzzer(Actor):
    """A node's station in the hands of somebody who has read the sources."""

    def __init__(self, swarm: str, seed: int, *, every_ms: float, lead_ms: float = 15) -> None:
        names = Topics(swarm)
        super().__init__(f"agent-{EVIL}", (names.radio_rx(EVIL),))
        self._topic = names.radio_tx(EVIL)
        self._pick = stream(seed, "fuzzer", EVIL)
        self._heard: dict[tuple[int, int], list[bytes]] = {}
        self._every_ns = round(every_ms * MS)
        self._lead_ns = round(lead_ms * MS)
        self._due_ns = 0
        self._receptions = 0
        self.sent = 0

    def start(self, now_ns: int) -> None:
        self._due_ns = now_ns + 200 * MS

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        if isinstance(message, Reception):
            self._receptions += 1
            kept = self._heard.setdefault(kind_of(message.frame), [])
            if len(kept) < _KEPT:
                kept.append(message.frame)
            else:
                kept[self._pick.randrange(_KEPT)] = message.frame

    def next_wake_ns(self) -> int | None:
        return self._due_ns

    def wake(self, now_ns: int) -> None:
        if now_ns < self._due_ns:
            return
        pick = self._pick
        self._due_ns = now_ns + round(self._every_ns * pick.uniform(0.2, 1.8))
        if not self._heard:
            return
        frame = pick.choice(self._heard[pick.choice([*self._heard])])
        others = self._heard[pick.choice([*self._heard])]
        for _ in range(pick.choice((1, 1, 1, 2, 3))):
            frame = mutations.frame_changed(frame, others, pick)
        if pick.random() < 0.8:
            frame = passed_off(frame, pick, now_ns=now_ns)
        dst = BROADCAST if pick.random() < 0.8 else NodeId(pick.randint(1, 9))
        frame = frame[:1500] or b"\0"
        self.outbox.append((self._topic, TxRequest(self.sent, now_ns + self._lead_ns, frame, dst, wants_status=False)))
        self.sent += 1

    def report(self) -> Mapping[str, Any]:
        own = {"kind": "agent", "node": EVIL, "generated": 0, "bus_malformed": 0}
        return {**own, "frames_sent": self.sent, "receptions": self._receptions, "dropped": {}}


def kind_of(frame: bytes) -> tuple[int, int]:
    """The kind of packet, and of a rival's control packet the type of its message."""
    kind = wire.peek_kind(frame)
    if kind is None:
        return -1, 0
    return kind, frame[_CONTROL_TYPE_AT] if kind == wire.Kind.ROUTING and len(frame) > _CONTROL_TYPE_AT else 0


def passed_off(frame: bytes, pick: Random, *, now_ns: int) -> bytes:
    """The frame with a header that its hearers believe at first: new, and its sender's own or handed on by it."""
    try:
        old = wire.decode_header(frame)
    except MalformedFrameError:
        return frame
    own = pick.random() < 0.6
    head = old._replace(
        prev_hop=EVIL,
        origin=EVIL if own else old.origin,
        hops=0 if own else max(1, old.hops),
        seq=(old.seq & 0x8000_0000) + pick.randrange(5_000),
        origin_us=max(0, now_ns // US - pick.randrange(50_000)),
    )
    return head.encode() + frame[wire.HEADER_BYTES :]


class Result(NamedTuple):
    """What became of one run."""

    name: str
    seed: int
    wrong: str
    frames: int
    took_s: float
    memory_mb: float
    trace: str

    def __str__(self) -> str:
        figures = f"{self.frames} frames, {self.took_s:.1f} s, {self.memory_mb:.0f} MB"
        return f"{self.name}, seed {self.seed}: {figures} {self.wrong}"


def run(name: str, seed: int, *, seconds: float = 12.0, limit_s: float = 300.0) -> Result:
    """One swarm with a fuzzer in it."""
    pick = Random(f"air/{name}/{seed}")
    found = corpus.scenario_of(name, f"duration_s={seconds}", f"seed={seed}")
    fuzzer = Fuzzer(found.name, seed, every_ms=pick.choice((5, 20, 80)))
    began_s, before_mb, wrong, trace = time.process_time(), _peak_mb(), "", ""
    try:
        summary = scenario_draws.run(found, limit_s=limit_s, instead=[fuzzer])
        if not summary["frames"]["closes"]:
            wrong = f"the ledger does not close: {summary['frames']}"
        trace = str((summary["frames"], summary["delivered"], summary.get("unknown")))
    except Exception:  # noqa: BLE001  (this program reports whatever goes wrong)
        wrong = traceback.format_exc(limit=-6)
    memory_mb = _peak_mb() - before_mb  # this process may have run much else before
    if memory_mb > MOST_MB:
        wrong += f"{memory_mb:.0f} MB"
    return Result(name, seed, wrong, fuzzer.sent, time.process_time() - began_s, memory_mb, trace)


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _of_pair(pair: tuple[str, int]) -> Result:
    return run(*pair)


def main() -> int:
    runs, first, processes = (
        int(sys.argv[at]) if len(sys.argv) > at else default
        for at, default in ((1, 510), (2, 0), (3, os.cpu_count() or 1))
    )
    warm_up()  # compiling may take longer than a run may
    names = list(corpus.SETTINGS)
    pairs = [(names[at % len(names)], first + at // len(names)) for at in range(runs)]
    began_s, wrong, frames, most_mb = time.perf_counter(), 0, 0, 0.0
    with ProcessPoolExecutor(processes) as pool:
        for count, result in enumerate(pool.map(_of_pair, pairs, chunksize=1), start=1):
            if count % 100 == 0:
                print(f"{count} runs, {wrong} with something wrong", flush=True)
            frames += result.frames
            most_mb = max(most_mb, result.memory_mb)
            if result.wrong:
                wrong += 1
                print(result, flush=True)
    took_s = time.perf_counter() - began_s
    print(
        f"{runs} runs of {len(names)} swarms in {took_s:.0f} s, {frames} frames of the fuzzer, {wrong} runs with "
        f"something wrong, at most {most_mb:.0f} MB"
    )
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
