"""Cases drawn by a seed, to which nobody tuned anything, beside ns-3.44: `python -m tests.validation.held_out PREFIX`.

Topology, rate, payload, number of nodes, distances, load and channel are drawn; OFDM with both error models. Five cases
of each kind. What ns-3 says is kept in `ns3/held_out.json`, from which `scripts/tables ns3-held-out` writes the table,
with ours as it is then. PREFIX: see `tests/ns3/live.py`. Figures agree as in `beyond_tables.py`.

Not drawn, because they are not meant to be alike: rates on channel A of which ns-3 receives a frame beneath another one
of the same power (1 and 2 Mb/s, and 6 by tables). Here every overlap on that channel is lost. Of retries the attempts
that fail are compared: where frames expire in the queue, as in overload, `air.mean_retries` counts the attempts that
these made, and the count of ns-3's traces does not.
"""

import argparse
import json
import os
import random
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Final

from fanet_mw.scenario.tables.radio import LEAST_SNR_DB
from tests.ns3 import live
from tests.validation.beyond_tables import Case, beside, theirs_of
from tests.validation.reference import CHANNEL, HEAD, Compared

SEED: Final = 20261126
KEPT: Final = Path(__file__).parent / "ns3" / "held_out.json"
_KINDS: Final = ("hidden", "chain", "grid", "disc")
_OF_EACH: Final = 5
_MANY: Final = 15
_SATURATED: Final = ("air.throughput_mbps", "air.attempt_failure")
_DSSS: Final = (1.0, 2.0, 5.5, 11.0)
_OFDM: Final = (6.0, 12.0, 18.0, 24.0, 36.0, 54.0)


def drawn(seed: int = SEED) -> Iterator[Case]:
    """All cases of a seed."""
    chance = random.Random(seed)
    for kind in _KINDS:
        for number in range(_OF_EACH):
            yield _case(chance, kind, number)


def _case(chance: random.Random, kind: str, number: int) -> Case:
    letter, standard = chance.choice("AB"), chance.choice("bba")
    errors, payload = chance.choice(("nist", "tables")), chance.randrange(100, 1400, 20)
    rates = _DSSS if standard == "b" else _OFDM
    rate = chance.choice([rate for rate in rates if letter == "B" or LEAST_SNR_DB[errors][rate] > 0])
    mode = [f"radio.channel={CHANNEL[letter]}", f"radio.standard={standard}", f"radio.rate_mbps={rate:g}"]
    mode += [f"traffic.payload_bytes={payload}", "radio.reference_loss_db=40.05"]
    said: dict[str, Any] = {"channel": letter, "standard": standard, "rate": f"{rate:g}", "payload": payload}
    if standard == "a":
        mode += [f"radio.ofdm_errors={errors}", "radio.energy_detection_dbm=-62"]
        said["errors"] = errors
    frame_s = (0.0008 if standard == "b" else 0.0002) + 8e-6 * (payload + 70) / rate
    cast = "unicast" if kind == "hidden" and number % 2 else chance.choice(("broadcast", "unicast"))
    what = f"{number + 1} {letter} {standard} {rate:g} Mb/s {payload} B"
    if standard == "a":
        what += f" {errors}"
    figures: tuple[str, ...] = ("pdr",)
    if kind == "grid":
        columns, rows = chance.randrange(3, 8), chance.randrange(2, 5)
        nodes, spacing = columns * rows, chance.randrange(100, 240, 10)
        sources = chance.randrange(1, nodes)
        interval_s = _rounded(sources * nodes * frame_s / chance.uniform(0.05, 0.8))
        jitter_ms = chance.choice((2, 5, 10, 20))
        ids = ",".join(str(node) for node in range(2, sources + 2))
        return Case(
            f"grid {what}, {columns} x {rows} at {spacing} m, {sources} every {interval_s:g} s", "flooding",
            (*mode, f"nodes.count={nodes}", f"nodes.columns={columns}", f"nodes.spacing_m={spacing}",
             f"traffic.sources=[{ids}]", f"traffic.interval_s={interval_s}", f"routing.jitter_ms={jitter_ms}"),
            {**said, "topology": "grid", "nodes": nodes, "columns": columns, "spacing": spacing, "sources": sources,
             "interval": interval_s, "jitter": jitter_ms / 1000},
            figures, seconds=max(10, round(8 * interval_s)),
        )  # fmt: skip
    arrivals = "poisson" if kind == "hidden" else chance.choice(("cbr", "poisson"))
    nodes = {"hidden": 3, "chain": chance.randrange(2, 9), "disc": chance.randrange(3, 31)}[kind]
    spacing = chance.randrange(130, 240, 10) if kind == "hidden" else chance.randrange(40, 200, 10)
    if kind == "chain" and cast == "unicast":
        spacing = min(spacing, 240 // (nodes - 1))
    if kind == "disc" and chance.random() < 0.4:
        arrivals, cast = "saturated", "unicast"
    senders = 2 if kind == "hidden" else nodes - (cast == "unicast")
    interval_s = _rounded(senders * frame_s / chance.uniform(0.1, 1.1))
    if cast == "unicast":
        figures = (
            ("air.throughput_mbps", "air.attempt_failure")
            if arrivals == "saturated"
            else ("pdr", "air.attempt_failure")
        )
    load = [f"traffic.arrivals={arrivals}"] + ([] if arrivals == "saturated" else [f"traffic.interval_s={interval_s}"])
    scenario = {"hidden": "hidden_terminal", "chain": "contention_broadcast", "disc": "contention_broadcast"}[kind]
    if kind != "hidden" and cast == "unicast":
        scenario = "contention_unicast"
    place = [] if kind == "disc" else [f"nodes.spacing_m={spacing}"]
    place += (
        [f"nodes.count={nodes}"] if kind != "hidden" else [f"traffic.destination={2 if cast == 'unicast' else 'all'}"]
    )
    place += ["nodes.layout=line"] if kind == "chain" else []
    where = "" if kind == "disc" else f" at {spacing} m"
    often = arrivals if arrivals == "saturated" else f"{arrivals} every {interval_s:g} s"
    return Case(
        f"{kind} {what}, {cast}, {nodes} nodes{where}, {often}", scenario, (*mode, *place, *load),
        {**said, "topology": kind, "nodes": nodes, "spacing": spacing, "cast": cast, "arrivals": arrivals,
         "interval": interval_s},
        figures, seconds=5 if nodes > _MANY else 10 if arrivals == "saturated" else 20,
    )  # fmt: skip


def _rounded(seconds: float) -> float:
    return float(f"{max(0.0004, seconds):.2g}")


def compared() -> Iterator[list[Compared]]:
    """Ours now beside what ns-3 said, case by case."""
    kept: Mapping[str, Sequence[Mapping[str, Any]]] = json.loads(KEPT.read_text(encoding="ascii"))
    cases = [case for case in drawn() if case.name in kept]
    with ProcessPoolExecutor() as pool:
        yield from pool.map(partial(beside, standard=False), cases, [kept[case.name] for case in cases])


def main() -> int:
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("prefix", type=Path, help="folder with include/ and lib64/ of ns-3.44")
    flags.add_argument("--seed", type=int, default=SEED, help="of the draw; another one than %(default)s is not kept")
    flags.add_argument("--only", default="", help="cases whose name contains this")
    flags.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes (%(default)s)")
    asked = flags.parse_args()
    cases = [case for case in drawn(asked.seed) if asked.only in case.name]
    done: list[Compared] = []
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(asked.jobs) as pool:
        program = live.build(asked.prefix, Path(folder))
        theirs = list(pool.map(partial(theirs_of, program=program), cases))
        if asked.seed == SEED:
            kept = json.loads(KEPT.read_text(encoding="ascii")) if KEPT.exists() else {}
            kept.update({case.name: said for case, said in zip(cases, theirs, strict=True)})
            KEPT.write_text(json.dumps(kept, indent=1) + "\n", encoding="ascii")
        print(HEAD)
        for found in pool.map(partial(beside, standard=False), cases, theirs):
            for figure in found:
                print(figure.line(), flush=True)
                done.append(figure)
    print(f"{sum(figure.agrees for figure in done)} of {len(done)} figures agree with ns-3")
    return 0 if done and all(figure.agrees for figure in done) else 1


if __name__ == "__main__":
    sys.exit(main())
