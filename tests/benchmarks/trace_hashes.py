"""Does a change alter what runs do? `trace_hashes.py save FILE` before it, `trace_hashes.py compare FILE` after it.

Every shipped scenario, shortened, and settings of `clustered` drawn at random: of each run the SHA-256 of its trace
file, of its reports, of what its nodes handed to MAVLink taps, and of its links. The same code gives the same hashes on
any machine of one kind (the radio's arithmetic is floating point), so a restructuring changes none of them.
`--only TEXT...` takes the runs whose name contains one of them.
"""

import argparse
import hashlib
import json
import random
import sys
from collections.abc import Iterator
from pathlib import Path
from time import process_time
from typing import Final, NamedTuple

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from sim.records.record_kinds import lines
from sim.results.links import described
from sim.run.virtual import simulate
from sim.scenarios import catalog

_SHIPPED: Final = {
    "clusters": 20, "contention_broadcast": 3, "contention_unicast": 3, "crossing": 20, "faults": 20, "flooding": 6,
    "hidden_terminal": 6, "quick": 20, "rescue": 20, "rescue-paper": 20, "rivals": 20, "town": 20,
}  # fmt: skip
"""Simulated seconds of each shipped scenario; of one that is not listed, `_OTHERS_S`."""
_OTHERS_S: Final = 14
_DRAWS: Final = 27
_BASES: Final = (
    ("quick", ["duration_s=24", "world.engine=kinematic", "nodes.count=12", "clusters.count=3"]),
    ("faults", ["duration_s=24", "clusters.flooding_period_s=0.5"]),
    ("clusters", ["duration_s=24", "warmup_s=9", "nodes.count=20", "clusters.count=19", "traffic.sources=19"]),
    ("crossing", ["duration_s=24", "traffic.interval_s=0.5"]),
)
_RULES: Final = {
    "all": [], "counter": [], "scheduled": [],
    "measured": ["clusters.relay=scheduled", "clusters.links=measured"],
}  # fmt: skip
"""What the draws take turns in: the values of `clusters.relay`, and timetables from measured links."""
_CHOICES: Final = {
    "clusters.repair_s": (0, 5, 10),
    "clusters.links": ("auto", "places", "measured"),
    "clusters.flooding_period_s": (0.5, 1, 2),
    "clusters.pacing": ("burst", "spread"),
    "clusters.guard_ms": ("auto", 1, 2),
    "clusters.reassign_s": (0, 2, 5),
    "clusters.turn_slack_us": (50, 400),
    "routing.aggregate": ("false", "true"),
    "routing.lifetime_s": (3, 30),
    "routing.hop_limit": (3, 32),
    "routing.queue_frames": (4, 512),
    "routing.hello_interval_s": (0.4, 1),
    "traffic.deadline_s": (None, None, 0.6, 2),
    "traffic.destination": ("all", "all", 2),
    "traffic.arrivals": ("cbr", "poisson"),
    "mobility.model": ("static", "random_waypoint", "formation"),
    "mobility.speed_m_s": (8, 40),
    "clock.sync": ("none", "none", "beacons", "gps"),
    "clock.drift_ppm": (0, 20),
    "clock.offset_ms": (0, 100),
    "radio.shadowing_db": (0, 0, 4),
    "radio.lead_ms": (0, 5, 40),
    "mission.survivors": (0, 6),
    "faults": (None, "[{at_s=10, kind='cut', node=1, for_s=20}]", "[{at_s=10, kind='cut', node=5, for_s=8}]"),
}


class Run(NamedTuple):
    """One run of the list."""

    name: str
    scenario: Scenario


def runs() -> Iterator[Run]:
    """Every shipped scenario in its short form, then the draws: each rule comes three times."""
    for entry in catalog.shipped():
        seconds = _SHIPPED.get(entry.name, _OTHERS_S)
        yield Run(entry.name, _shortened(entry.name, [f"duration_s={seconds}"]))
    for number in range(_DRAWS):
        rule = list(_RULES)[number % len(_RULES)]
        settings = _RULES[rule] or [f"clusters.relay={rule}"]
        yield Run(f"{rule}-{number}", _drawn(settings, random.Random(f"traces/{number}")))


def _shortened(name: str, settings: list[str]) -> Scenario:
    try:
        return catalog.find(name, settings)
    except ConfigError:  # what begins late begins sooner in a short run
        return catalog.find(name, [*settings, "warmup_s=2", "drain_s=1"])


def _drawn(rule: list[str], pick: random.Random) -> Scenario:
    """A setting that the model accepts; a value that it refuses beside the others stays out."""
    base, settings = pick.choice(_BASES)
    settings = [*settings, *rule]
    found = _shortened(base, settings)
    fixed = {setting.partition("=")[0] for setting in rule}
    for key, values in sorted(_CHOICES.items()):
        value = pick.choice(values)
        if value is None or pick.random() < 0.3 or key in fixed:
            continue
        try:
            found = _shortened(base, [*settings, f"{key}={value}"])
        except ConfigError:
            continue
        settings.append(f"{key}={value}")
    return found


def hashes(scenario: Scenario) -> dict[str, str]:
    """What a run gives, by part."""
    outcome = simulate(scenario)
    parts = {
        "trace": b"".join(lines(outcome.records)),
        "reports": json.dumps(dict(outcome.reports), sort_keys=True).encode(),
        "taps": repr([*outcome.taps]).encode(),
        "links": json.dumps(list(described(outcome.links.rows()))).encode(),
    }
    return {part: hashlib.sha256(data).hexdigest()[:24] for part, data in parts.items()}


def main() -> int:
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("what", choices=("save", "compare"))
    flags.add_argument("file", type=Path)
    flags.add_argument("--only", default=[""], nargs="+", help="the runs whose name contains one of these")
    given = flags.parse_args()
    before = json.loads(given.file.read_text()) if given.what == "compare" else {}
    found: dict[str, dict[str, str]] = {}
    differing = 0
    for name, scenario in runs():
        if not any(part in name for part in given.only):
            continue
        began_s = process_time()
        found[name] = hashes(scenario)
        verdict = ""
        if given.what == "compare":
            parts = [part for part, digest in found[name].items() if before.get(name, {}).get(part) != digest]
            differing += bool(parts)
            verdict = f"DIFFERS: {', '.join(parts)}" if parts else "same"
        print(f"{name:24} {found[name]['trace']} {process_time() - began_s:6.1f} s  {verdict}", flush=True)
    if given.what == "save":
        given.file.write_text(json.dumps(found, indent=1) + "\n")
    else:
        print(f"{len(found)} runs, {differing} differ")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
