"""Random valid scenarios, out of the model itself: every key, every choice, values at their bounds and between.

A draw puts values into keys in a random order; a value that the model refuses beside what is there already stays out,
so what remains is valid. Only what costs time is kept small: nodes, seconds and buildings.

`scenario_draws.py [RUNS [FIRST_SEED [PROCESSES]]]` is the long run: each draw is run to its end in virtual time, and
what goes wrong is printed with the scenario that shows it.
"""

import json
import math
import os
import random
import signal
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from types import FrameType, NoneType, UnionType
from typing import Annotated, Any, Final, Literal, NamedTuple, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from fanet_mw.actor import Actor
from fanet_mw.errors import ConfigError
from fanet_mw.extensions import PartName
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.scenario import Scenario, config
from fanet_mw.scenario.tables.sections import Section
from fanet_mw.trace import Record
from fanet_mw.units import S
from sim.results.metrics import summarize
from sim.results.outcome import Outcome
from sim.run.virtual import actors_of

LEAST_WAKES: Final = 20_000
WAKES_A_SECOND: Final = 60_000
"""Of one actor, whatever the scenario asks for: the densest traffic is 10,000 packets a second."""
_KEPT: Final = {
    "name", "description", "faults", "time_scale", "duration_s", "seed", "traffic.interval_s",
    "routing.options", "clusters.options", "radio.options", "mobility.options",
    "world.heightmap", "world.buildings_geojson", "world.heightmap_sha256", "world.buildings_sha256",
    "world.physics_hz", "traffic.name", "traffic.packets_csv", "applications", "further_traffic",
    "clock.jumps",
}  # fmt: skip
"""Keys that are set below, mean nothing in virtual time, belong to parts of other packages, or name files."""
_SMALL: Final = {
    "nodes.count": (1, 9), "world.buildings": (0, 4), "mission.survivors": (0, 12),
    "clusters.count": (1, 8),
}  # fmt: skip
_SEED_KEYS: Final = (
    "routing.protocol", "clusters.relay", "radio.channel", "radio.standard", "radio.rate_mbps", "radio.access",
    "world.engine", "nodes.count",
)  # fmt: skip
"""Drawn first: what others depend on."""


class Key(NamedTuple):
    """One key of the model."""

    name: str
    annotation: Any
    metadata: tuple[Any, ...]
    default: Any


def every_key(model: type[Section] = Scenario, prefix: str = "") -> Iterator[Key]:
    """Every key that a file may set."""
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, Section):
            yield from every_key(inner, f"{prefix}{name}.")
        else:
            yield Key(prefix + name, inner, tuple(field.metadata), field.default)


def scenario(seed: int) -> tuple[Scenario, dict[str, Any]]:
    """A random valid scenario, and the keys that make it."""
    pick = random.Random(f"draw/{seed}")
    dense = pick.random() < 0.03  # right, and a minute's work for each second
    chosen: dict[str, Any] = {
        "name": "draw", "seed": seed, "duration_s": 0.5 if dense else pick.choice([0.5, 2, 5, 12]),
        "traffic.interval_s": 10 ** (pick.uniform(-4, -3) if dense else pick.uniform(-2.5, 1)),
    }  # fmt: skip
    found = config.build({**tree(chosen), "nodes": {"count": 1}, "clusters": {"count": 1}})
    every = {key.name: key for key in every_key()}
    order = [name for name in every if name not in _SEED_KEYS and name not in _KEPT]
    pick.shuffle(order)
    share = pick.choice([0.05, 0.15, 0.4])
    order = [name for name in order if pick.random() < share]
    for name in (*_SEED_KEYS, *order):
        value = _value(every[name], pick)
        try:
            found = config.build(tree({**chosen, name: value}))
        except ConfigError:
            if name == "nodes.count":  # the default number of clusters asks for more nodes
                chosen |= {name: value, "clusters.count": 1}
                found = config.build(tree(chosen))
            continue
        chosen[name] = value
    faults = [_fault(pick, found.nodes.count) for _ in range(pick.choice([0, 0, 0, 1, 3]))]
    try:
        found = config.build(tree({**chosen, "faults": faults}))
        chosen["faults"] = faults
    except ConfigError:
        pass
    return found, chosen


def tree(flat: dict[str, Any]) -> dict[str, Any]:
    """Nested tables out of dotted keys."""
    found: dict[str, Any] = {}
    for key, value in flat.items():
        *path, last = key.split(".")
        table = found
        for part in path:
            table = table.setdefault(part, {})
        table[last] = value
    return found


def _value(key: Key, pick: random.Random) -> Any:
    if key.name == "routing.protocol" and pick.random() < 0.4:
        return "clustered"  # has more keys, and more to go wrong, than all others together
    if key.name in _SMALL:
        return pick.randint(*_SMALL[key.name])
    if key.name == "nodes.positions_m":
        return []
    if key.annotation is str or "PlannedOrder" in str(key.annotation):
        return key.default  # the name of a file, or what an operator wants
    if key.name == "radio.rate_mbps" or key.name == "radio.ack_rate_mbps":
        return pick.choice([1.0, 2.0, 5.5, 11.0, 6.0, 24.0, 54.0])
    for item in key.metadata:
        if isinstance(item, PartName):
            return pick.choice(item.ours)
    value = _of(key.annotation, key.metadata, pick)
    if type(value) is type(key.default) is float and value > 0 and pick.random() < 0.5:
        return key.default * 10 ** pick.uniform(-1.5, 1.5)
    return value


def _of(annotation: Any, metadata: tuple[Any, ...], pick: random.Random) -> Any:
    """A value of an annotation, within what its metadata allow."""
    origin = get_origin(annotation)
    if origin is Annotated:
        base, *more = get_args(annotation)
        return _of(base, (*metadata, *more), pick)
    if origin is Literal:
        return pick.choice(get_args(annotation))
    if origin in (Union, UnionType):
        branch = pick.choice([arm for arm in get_args(annotation) if arm not in (NoneType, str)])
        return _of(branch, metadata, pick)
    if origin is tuple:
        arms = get_args(annotation)
        if len(arms) == 2 and arms[1] is Ellipsis:
            return [_of(arms[0], (), pick) for _ in range(pick.randint(0, 3))]
        return [_of(arm, (), pick) for arm in arms]
    if annotation is bool:
        return pick.random() < 0.5
    if annotation in (int, float):
        return _number(annotation, _bounds(metadata), pick)
    raise AssertionError(f"no draw for {annotation}")


def _bounds(metadata: tuple[Any, ...]) -> tuple[float, float]:
    """The least and the greatest value; a model without them would leave a run without an end."""
    low, high = None, None
    for item in metadata:
        for part in (item, *(item.metadata if isinstance(item, FieldInfo) else ())):
            low = getattr(part, "ge", None) if low is None else low
            low = getattr(part, "gt", None) if low is None else low
            high = getattr(part, "le", None) if high is None else high
            high = getattr(part, "lt", None) if high is None else high
    assert low is not None, f"a number without a least value: {metadata}"
    assert high is not None, f"a number without a greatest value: {metadata}"
    return low, high


def _number(kind: type, bounds: tuple[float, float], pick: random.Random) -> Any:
    low, high = bounds
    dice = pick.random()
    if dice < 0.25:
        value = low
    elif dice < 0.4:
        value = high
    elif low < 0 or high <= 1:
        value = pick.uniform(low, high)
    else:
        least = max(low, 1e-6)
        value = math.exp(pick.uniform(math.log(least), math.log(max(high, least))))
    return round(value) if kind is int else value


def _fault(pick: random.Random, count: int) -> dict[str, Any]:
    at = {"at_s": pick.choice([0, 0.3, pick.uniform(0, 4)]), "for_s": pick.choice([0, 1e-9, 0.2, 1e6])}
    node, other = pick.randint(1, count), pick.randint(1, count)
    return pick.choice([
        {"kind": "cut", "node": node, **at},
        {"kind": "jam", "center_m": [0, 0], "radius_m": pick.choice([1, 500, 1e5]), **at},
        {"kind": "degrade", "src": node, "dst": other, "loss_share": pick.random(), **at},
        {"kind": "restore", "at_s": at["at_s"]},
    ])  # fmt: skip


# --- one run ----------------------------------------------------------------------------------------------------------


class EndlessError(Exception):
    """The run does not end."""


@contextmanager
def _alarm(limit_s: float) -> Iterator[None]:
    """Raises EndlessError in whatever uses more processor time than this."""

    def ring(_signal: int, _frame: FrameType | None) -> None:
        raise EndlessError(f"still running after {limit_s:g} s")

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def run(
    found: Scenario, *, limit_s: float = 120.0, instead: Sequence[Actor] = (), reports: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Run it to its end, counting wake-ups; the summary. Raises EndlessError, or whatever the run raises.

    `instead`: actors that take the place of those of the same name; `reports` is filled with what all report.
    """
    records: list[Record] = []
    others = {actor.name: actor for actor in instead}
    actors = [others.get(actor.name, actor) for actor in actors_of(found, found.name)]
    for actor in actors:
        _count_wakes(actor, LEAST_WAKES + found.duration_s * WAKES_A_SECOND)
    host = VirtualHost(actors, on_records=records.extend)
    with _alarm(limit_s):
        host.start()
        for second in range(1, math.ceil(found.duration_s) + 1):
            host.run(min(second * S, found.duration_ns))
        host.stop()
        outcome = Outcome(
            scenario=found, mode="virtual", wall_s=0.0, records=records,
            reports={actor.name: actor.report() for actor in actors},
        )  # fmt: skip
        summary = summarize(outcome, trace_sha256="")
        json.dumps(dict(outcome.reports))
        if reports is not None:
            reports.update(outcome.reports)
    return summary


def _count_wakes(actor: Any, most: float) -> None:
    wake, woken = actor.wake, 0

    def counted(now_ns: int) -> None:
        nonlocal woken
        woken += 1
        if woken > most:
            raise EndlessError(f"{actor.name} was woken {woken} times by {now_ns / S} s")
        wake(now_ns)

    actor.wake = counted


def check(seed: int, limit_s: float = 120.0) -> str:
    """What is wrong with this draw; empty: nothing."""
    began = time.perf_counter()
    try:
        found, chosen = scenario(seed)
    except Exception:  # noqa: BLE001  (this program reports whatever goes wrong)
        return f"seed {seed}: {traceback.format_exc()}"
    try:
        summary = run(found, limit_s=limit_s)
        wrong = "" if summary["frames"]["closes"] else f"the ledger does not close: {summary['frames']}"
    except ConfigError:  # what only the layout shows
        wrong = ""
    except Exception:  # noqa: BLE001
        wrong = traceback.format_exc(limit=-6)
    took_s = time.perf_counter() - began
    return f"seed {seed}, {took_s:.1f} s: {wrong}\n{json.dumps(chosen)}\n" if wrong else ""


def main() -> int:
    runs, first, processes = (
        int(sys.argv[at]) if len(sys.argv) > at else default
        for at, default in ((1, 1000), (2, 0), (3, os.cpu_count() or 1))
    )
    began, wrong = time.perf_counter(), 0
    with ProcessPoolExecutor(processes) as pool:
        for text in pool.map(check, range(first, first + runs), chunksize=1):
            if text:
                wrong += 1
                print(text, flush=True)
    print(f"{runs} scenarios in {time.perf_counter() - began:.0f} s, {wrong} with something wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
