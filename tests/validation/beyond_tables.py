"""Cases that are in no table, ours beside a live ns-3.44: `python tests/validation/beyond_tables.py PREFIX [--only X]`.

Other node counts, loads, arrivals and jitters than in `ns3/`, on both channels; four seeds of each side, ours with both
ways of access. They agree as in `reference.py`, but for the standard errors: these are of both sides' scatter, because
four runs of one side tell it badly. Only figures that can disagree are counted. PREFIX: see `tests/ns3/live.py`.
"""

import argparse
import math
import statistics
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Final, NamedTuple

from tests.ns3 import live
from tests.validation.reference import CHANNEL, HEAD, Compared, Metric, at, summary_of, verdict

_SEEDS: Final = (1, 2, 3, 4)
_RELATIVE: Final = {"air.throughput_mbps": 0.03, "air.mean_retries": 0.05}
_BROADCAST: Final = (
    (5, 0.01, "cbr"),
    (20, 0.02, "cbr"),
    (20, 0.02, "poisson"),
    (30, 0.03, "cbr"),
    (30, 0.05, "poisson"),
)
_SATURATED: Final = (3, 10, 20, 30)
_UNICAST: Final = ((20, 0.03, "poisson"), (20, 0.04, "cbr"), (30, 0.04, "poisson"), (10, 0.015, "poisson"))
_HIDDEN: Final = (0.005, 0.02, 0.05)
_FLOODS: Final = ((1, 0.1, 0), (1, 0.1, 1), (10, 1, 10), (10, 0.2, 5), (44, 1, 1), (44, 0.5, 20), (44, 1, 50))


class Case(NamedTuple):
    """The same in the words of both sides."""

    name: str
    scenario: str
    ours: tuple[str, ...]
    theirs: dict[str, Any]
    figures: tuple[str, ...] = ("pdr",)
    seconds: int = 20


def cases() -> Iterator[Case]:
    for letter, channel in CHANNEL.items():
        for case in _of_channel(letter):
            theirs = {"channel": letter, **case.theirs}
            yield case._replace(ours=(f"radio.channel={channel}", *case.ours), theirs=theirs)


def _of_channel(letter: str) -> Iterator[Case]:
    for count, interval_s, arrivals in _BROADCAST:
        yield Case(
            f"{letter} broadcast n={count} every {interval_s} s {arrivals}", "contention_broadcast",
            (f"nodes.count={count}", *_load(interval_s, arrivals)),
            {"topology": "disc", "nodes": count, "interval": interval_s, "arrivals": arrivals}, ("pdr", "air.pdr"),
        )  # fmt: skip
    unicast = {"topology": "disc", "cast": "unicast"}
    for senders in _SATURATED:
        yield Case(
            f"{letter} unicast {senders} saturated", "contention_unicast",
            (f"nodes.count={senders + 1}", "traffic.arrivals=saturated"),
            {**unicast, "nodes": senders + 1, "arrivals": "saturated"},
            ("air.throughput_mbps", "air.attempt_failure"), seconds=10,
        )  # fmt: skip
    for senders, interval_s, arrivals in _UNICAST:
        yield Case(
            f"{letter} unicast {senders} every {interval_s} s {arrivals}", "contention_unicast",
            (f"nodes.count={senders + 1}", *_load(interval_s, arrivals)),
            {**unicast, "nodes": senders + 1, "interval": interval_s, "arrivals": arrivals},
        )  # fmt: skip
    for interval_s, cast in product(_HIDDEN, ("broadcast", "unicast")):
        yield Case(
            f"{letter} hidden {cast} every {interval_s} s", "hidden_terminal",
            (f"traffic.destination={'2' if cast == 'unicast' else 'all'}", *_load(interval_s, "poisson")),
            {"topology": "hidden", "cast": cast, "interval": interval_s, "arrivals": "poisson"},
        )  # fmt: skip
    for sources, interval_s, jitter_ms in _FLOODS:
        ids = ",".join(str(node) for node in range(2, sources + 2))
        yield Case(
            f"{letter} flooding by {sources} every {interval_s} s, jitter {jitter_ms} ms", "flooding",
            (f"traffic.sources=[{ids}]", f"routing.jitter_ms={jitter_ms}", f"traffic.interval_s={interval_s}"),
            {"topology": "grid", "sources": sources, "interval": interval_s, "jitter": jitter_ms / 1000},
        )  # fmt: skip


def _load(interval_s: float, arrivals: str) -> tuple[str, str]:
    return f"traffic.interval_s={interval_s}", f"traffic.arrivals={arrivals}"


def compare(case: Case, *, program: Path) -> list[Compared]:
    """Every figure of a case, ours beside ns-3 that runs now."""
    return beside(case, theirs_of(case, program))


def theirs_of(case: Case, program: Path) -> list[dict[str, Any]]:
    """What ns-3 says with each seed."""
    return [live.run(program, duration=case.seconds, run=seed, **case.theirs) for seed in _SEEDS]


def beside(case: Case, theirs: Sequence[Mapping[str, Any]], *, standard: bool = True) -> list[Compared]:
    """Every figure of a case, ours beside what ns-3 said; NaN for the standard's access if that is not asked for."""
    ours, other = [
        [
            summary_of(case.scenario, (*case.ours, f"duration_s={case.seconds}", f"radio.access={access}"), seed)
            for seed in (_SEEDS if wanted else ())
        ]
        for access, wanted in (("ns3", True), ("standard", standard))
    ]
    found = []
    for figure in case.figures:
        reference, sd = _mean_and_sd(said[figure] for said in theirs)
        mean, own_sd = _mean_and_sd(at(summary, figure) for summary in ours)
        both_sd = math.hypot(sd, own_sd) / math.sqrt(2)
        metric = Metric(figure, reference, both_sd, len(_SEEDS), _RELATIVE.get(figure, 0.0))
        by_standard = statistics.fmean(at(summary, figure) for summary in other) if other else math.nan
        found.append(Compared(case.name, metric, len(_SEEDS), mean, by_standard))
    return found


def _mean_and_sd(figures: Iterable[float]) -> tuple[float, float]:
    values: Sequence[float] = list(figures)
    return statistics.mean(values), statistics.stdev(values)


def main() -> int:
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("prefix", type=Path, help="folder with include/ and lib64/ of ns-3.44")
    flags.add_argument("--only", default="", help="cases whose name contains this")
    asked = flags.parse_args()
    chosen = [case for case in cases() if asked.only in case.name]
    done: list[Compared] = []
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor() as pool:
        program = live.build(asked.prefix, Path(folder))
        print(HEAD)
        for found in pool.map(partial(compare, program=program), chosen):
            for compared in found:
                print(compared.line(), flush=True)
                done.append(compared)
    print(verdict(done))
    return 0 if done and all(compared.agrees for compared in done) else 1


if __name__ == "__main__":
    sys.exit(main())
