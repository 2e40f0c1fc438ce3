"""Cases that are in no table, ours beside a live ns-3.44: `python tests/validation/beyond_tables.py PREFIX [--only X]`.

Other node counts, loads, arrivals and jitters than in `ns3/`, on both channels; four seeds of each side. They agree
within 0.02, 3 % of a throughput, 3 standard deviations of ns-3 or 3 standard errors of the difference, the widest.
PREFIX: see `tests/ns3/live.py`.
"""

import argparse
import math
import statistics
import sys
import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Final, NamedTuple

from tests.ns3 import live
from tests.validation.reference import CHANNEL, at, summary_of

_SEEDS: Final = 4
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


def compare(case: Case, *, program: Path) -> list[tuple[str, bool]]:
    """A line per figure, and whether it agrees."""
    seeds = range(1, _SEEDS + 1)
    theirs = [live.run(program, duration=case.seconds, run=seed, **case.theirs) for seed in seeds]
    settings = (*case.ours, f"duration_s={case.seconds}")
    summaries = [summary_of(case.scenario, settings, seed) for seed in seeds]
    lines = []
    for figure in case.figures:
        reference, sd = _mean_and_sd(said[figure] for said in theirs)
        found, own_sd = _mean_and_sd(at(summary, figure) for summary in summaries)
        error = math.hypot(sd, own_sd) / math.sqrt(_SEEDS)
        tolerance = max(0.03 * reference if figure == "air.throughput_mbps" else 0.02, 3 * sd, 3 * error)
        agrees = abs(found - reference) <= tolerance
        lines.append(
            (
                f"{case.name:48} {figure:20} {found:7.4f} +- {own_sd:.4f} {reference:7.4f} +- {sd:.4f} "
                f"{found - reference:+8.4f} {tolerance:7.4f}{'' if agrees else '  DIFFERS'}",
                agrees,
            )
        )
    return lines


def _mean_and_sd(figures: Iterable[float]) -> tuple[float, float]:
    values = list(figures)
    return statistics.mean(values), statistics.stdev(values)


def main() -> int:
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("prefix", type=Path, help="folder with include/ and lib64/ of ns-3.44")
    flags.add_argument("--only", default="", help="cases whose name contains this")
    asked = flags.parse_args()
    chosen = [case for case in cases() if asked.only in case.name]
    verdicts: list[bool] = []
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor() as pool:
        program = live.build(asked.prefix, Path(folder))
        print(f"{'case':48} {'figure':20} {'ours':>17} {'ns-3':>17} {'diff':>9} {'within':>7}")
        for lines in pool.map(partial(compare, program=program), chosen):
            for line, agrees in lines:
                print(line, flush=True)
                verdicts.append(agrees)
    print(f"{sum(verdicts)} of {len(verdicts)} figures agree")
    return 0 if verdicts and all(verdicts) else 1


if __name__ == "__main__":
    sys.exit(main())
