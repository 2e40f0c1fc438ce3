"""Short flights over everything that a swarm does (`kept_flights.txt`), and what each came to (`kept_flights.json`).

    python tests/integration/kept_flights.py [--write] [NAME ...]     compares, or writes anew

Of each flight a digest per kind of record, of the reports and of each part of the summary, so a difference has a place.
Numbers are rounded to three decimals, because processors differ in the last bits.
"""

import json
import sys
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from time import process_time
from typing import Any, Final

from fanet_mw import trace
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

FILE: Final = Path(__file__).with_suffix(".json")
_MACHINE: Final = {"wall_s", "trace_sha256", "files"}


def _read(text: str) -> dict[str, list[str]]:
    """The settings of each flight, behind the scenario that they change; capital names stand for several."""
    several: dict[str, list[str]] = {}
    for line in text.replace("\n    ", " ").splitlines():
        name, _, words = line.partition(": ")
        several[name] = [key for word in words.split() for key in several.get(word, [word])]
    return {name: keys for name, keys in several.items() if not name.isupper()}


FLIGHTS: Final[Mapping[str, list[str]]] = _read(Path(__file__).with_suffix(".txt").read_text())


def rounded(value: Any) -> Any:
    """A value whose last bits do not count."""
    match value:
        case bool() | int() | str() | None:
            return value
        case float():
            return round(value, 3) + 0.0 if abs(value) < 1e6 else float(f"{value:.6g}")
        case Mapping():
            return {str(key): rounded(inner) for key, inner in sorted(value.items(), key=lambda item: str(item[0]))}
        case list() | tuple() | set() | frozenset():
            return [rounded(inner) for inner in (sorted(value) if isinstance(value, set | frozenset) else value)]
    return str(value)


def digest(value: Any) -> str:
    return f"{zlib.crc32(json.dumps(rounded(value)).encode()):08x}"


def parts(name: str) -> Iterator[tuple[str, str]]:
    """What one flight came to, part by part."""
    base, *settings = FLIGHTS[name]
    outcome = simulate(catalog.find(base, settings))
    kinds: dict[str, tuple[int, int]] = {}
    for record in outcome.records:
        kind = trace.name_of(type(record))
        count, so_far = kinds.get(kind, (0, 0))
        kinds[kind] = count + 1, zlib.crc32(json.dumps(rounded(tuple(record))).encode(), so_far)
    for kind, (count, code) in sorted(kinds.items()):
        yield kind, f"{count} {code:08x}"
    yield "reports", digest(outcome.reports)
    yield "links", digest([tuple(row) for row in outcome.links.rows()])
    yield "taps", digest([(t_ns, len(data), data[7:10].hex()) for t_ns, data in outcome.taps])  # which messages when
    summary = finish(outcome, out=None)
    yield "ledgers close", str(summary["frames"]["closes"] and summary["copies"]["closes"])
    for key, value in summary.items():
        if key not in _MACHINE:
            yield f"summary.{key}", digest(value)


def main(arguments: list[str]) -> int:
    kept = json.loads(FILE.read_text()) if FILE.exists() else {}
    names = [name for name in arguments if name != "--write"] or list(FLIGHTS)
    differing = 0
    for name in names:
        began_s = process_time()
        found = dict(parts(name))
        wrong = sorted(
            part for part in {*found, *kept.get(name, {})} if found.get(part) != kept.get(name, {}).get(part)
        )
        differing += bool(wrong)
        print(f"{name:22} {process_time() - began_s:5.1f} s  {', '.join(wrong)[:90] or 'same'}", flush=True)
        kept[name] = found
        if "--write" in arguments:
            FILE.write_text(json.dumps({name: kept[name] for name in FLIGHTS if name in kept}, indent=1) + "\n")
    return 1 if differing and "--write" not in arguments else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
