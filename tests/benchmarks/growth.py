"""Which containers of the actors grow in a long run, by name: what a leak would be, or a bounded store that fills.

`python tests/benchmarks/growth.py SCENARIO SECONDS [KEY=VALUE ...]` runs the scenario in virtual time, throws its trace
away, and after each quarter of the run counts the entries of every container that an actor reaches, added up by the
class and attribute that hold it. It prints those that have grown since the quarter before, most first.

Processes grow for other reasons, too: what the allocator and Zenoh keep. `soak.py` shows what these are together.
"""

import gc
import sys
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from typing import Final

from fanet_mw.actor import Actor
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.units import S
from sim.run.virtual import actors_of
from sim.scenarios import catalog

_PACKAGES: Final = ("agents", "fanet_mw", "emulator", "sim")
_CONTAINERS: Final = (list, set, frozenset, deque)
_LEAVES: Final = (int, float, str, bytes, type, type(None))
_FEW: Final = 20
"""Containers that grew by fewer entries than this between two quarters are not told: they come and go."""


def entries(actors: Sequence[Actor]) -> Counter[str]:
    """The entries of all containers that actors reach, by `Class.attribute`; one inside another has a `[]` more."""
    counts: Counter[str] = Counter()
    seen: set[int] = set()
    waiting: list[tuple[object, str]] = [(actor, type(actor).__name__) for actor in actors]
    while waiting:
        value, place = waiting.pop()
        if id(value) in seen:
            continue
        seen.add(id(value))
        if isinstance(value, (dict, *_CONTAINERS)):
            counts[place] += len(value)
        waiting += [part for part in _parts(value, place) if not isinstance(part[0], _LEAVES)]
    return counts


def _parts(value: object, place: str) -> Iterator[tuple[object, str]]:
    """What a value holds, each with the place in which it stands."""
    if isinstance(value, dict):
        yield from ((part, f"{place}[]") for pair in value.items() for part in pair)
    elif isinstance(value, (tuple, *_CONTAINERS)):
        yield from ((part, f"{place}[]") for part in value)
    elif (method := getattr(value, "__self__", None)) is not None:
        yield method, type(method).__name__
    elif type(value).__module__.partition(".")[0] in _PACKAGES:
        slots = (name for kind in type(value).__mro__ for name in getattr(kind, "__slots__", ()))
        for name in (*slots, *getattr(value, "__dict__", ())):
            if hasattr(value, name):
                yield getattr(value, name), f"{type(value).__name__}.{name}"


def grown(scenario: str, seconds: int, overrides: Sequence[str]) -> Iterator[tuple[float, Counter[str], Counter[str]]]:
    """For each quarter but the first: its end in seconds, the entries then, and those of the quarter before."""
    actors = actors_of(catalog.find(scenario, [f"duration_s={seconds}", *overrides]), "growth")
    host = VirtualHost(actors, on_records=lambda _: None)
    host.start()
    before: Counter[str] | None = None
    for quarter in range(1, 5):
        host.run(quarter * seconds * S // 4)
        gc.collect()
        now = entries(actors)
        if before is not None:
            yield quarter * seconds / 4, now, before
        before = now


def main() -> None:
    """Print what grows."""
    scenario, seconds, *overrides = sys.argv[1:]
    for end_s, now, before in grown(scenario, int(seconds), overrides):
        print(f"{end_s:g} s: {now.total()} entries")
        for place, more in (now - before).most_common():
            if more >= _FEW:
                print(f"  {place}: {before[place]} to {now[place]}")


if __name__ == "__main__":
    main()
