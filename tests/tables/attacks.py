"""What attacks and faults came to in simulation and as real processes: the tables of docs/results/attacks.md.

Each attack of `tests/integration/air_attacks.py` runs alone in both modes. On the bus nothing can be forged in a
simulation, which has none; and a simulated process does not die. The tests' own modules are imported where they are
needed: whoever only wants to know which tables there are has no use for them.
"""

import itertools
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from signal import Signals
from typing import Any, Final, NamedTuple

from sim.results.files import finish
from tests.tables.markdown import Rows

MACHINE: Final = ("seen as real processes",)
_REFUSALS: Final = ("malformed", "forged", "unknown_node", "own")
_REFUSED: Final = ("old", "relayed", "repeated", "forged", "duplicate", "expired", "own")
_REAL: Final = ("radio.lead_ms=150", "duration_s=17")
"""Of real processes: not asked is whether this machine is on time, and half of the attack is enough."""


def over_the_air() -> Rows:
    """One row for each attack."""
    _find_tests()
    import air_attacks
    import realtime_attacks
    import scenario_draws
    from attacker import Attacker

    rows = [["attack", "promise", "seen in simulation", "seen as real processes"]]
    for name, attack in air_attacks.ATTACKS.items():
        found = air_attacks.scenario(*attack.keys)
        reports: dict[str, Any] = {}
        evil = Attacker(air_attacks.EVIL, found.name, attack.plan())
        summary = scenario_draws.run(found, limit_s=60, instead=[evil], reports=reports)
        real = realtime_attacks.attacked_in_real_time(air_attacks.scenario(*attack.keys, *_REAL), name)
        honest = [f"agent-{node}" for node in air_attacks.HONEST]
        cells = [_seen(summary, reports, honest), _seen(finish(real, out=None), real.reports, honest, real.ended)]
        rows.append([name, attack.promise or "what it is without attack", *cells])
    return rows


def _find_tests() -> None:
    """Let the modules of the tests be found by the names by which they import each other."""
    for name in ("integration", "hostile"):
        folder = str(Path(__file__).parents[1] / name)
        if folder not in sys.path:
            sys.path.append(folder)


def replays() -> Rows:
    """One row for each scenario, kind of frame and address, of the runs that `tests/hostile/replays.py` has flown."""
    _find_tests()
    import replays as flown

    verdicts, matrix = flown.kept(), flown.matrix()
    rows = [[
        "scenario", "repeated", "under the address", "runs", "frames sent", "least share delivered", "with nonsense",
        "clocks apart [us]", "without it", "beyond their error", "refused",
    ]]  # fmt: skip
    for scenario, kinds in flown.KINDS.items():
        for kind, spoofed in itertools.product(kinds, (False, True)):
            of = [v for a, v in verdicts.items() if (a.scenario, a.kind, a.spoofed) == (scenario, kind, spoofed)]
            if not of:
                continue
            planned = sum((a.scenario, a.kind, a.spoofed) == (scenario, kind, spoofed) for a in matrix)
            least = min(of, key=lambda verdict: verdict.share)
            without = [verdict.apart_without_us for verdict in of if verdict.apart_without_us is not None]
            refused: Counter[str] = Counter()
            for verdict in of:
                refused.update(verdict.refused)
            rows.append([
                scenario, kind.name.lower(), "of whom it repeats" if spoofed else "its own", f"{len(of)} of {planned}",
                f"{sum(verdict.sent for verdict in of):,}", f"{least.share:.4f}",
                "-" if least.noise_share is None else f"{least.noise_share:.4f}",
                f"{max(verdict.apart_us for verdict in of):.0f}", f"{max(without):.0f}" if without else "-",
                str(sum(max(0, verdict.beyond) for verdict in of)),
                ", ".join(f"{count:,} {why}" for why, count in sorted(refused.items()) if why in _REFUSED),
            ])  # fmt: skip
    return rows


def _seen(
    summary: Mapping[str, Any], reports: Mapping[str, Any], honest: Sequence[str], ended: Sequence[object] = ()
) -> str:
    """What became of it in one run, in a few words."""
    told = [reports[name] for name in honest if name in reports]
    refused = {why: sum(report["dropped"].get(why, 0) for report in told) for why in _REFUSALS}
    said = [f"PDR {summary['pdr']:.3f}", *(f"{count} {why}" for why, count in refused.items() if count)]
    if summary["unknown"]:
        said.append(f"{summary['unknown']} unknown")
    if "error_us" in summary["clock"]:
        said.append(f"clocks off by up to {summary['clock']['error_us']['max']:.0f} us")
    if ended:
        said.append(f"{len(ended)} processes ended")
    if not summary["frames"]["closes"]:
        said.append("the books do not close")
    return ", ".join(said)


def on_the_bus_and_to_processes() -> Rows:
    """One row for each attack on the bus, and for each fault of a process."""
    _find_tests()
    import test_realtime_attacks as bus
    import test_realtime_verdict as verdict

    rows = [["attack or fault", "promise", "seen as real processes"]]
    for (name, promise), puts in zip(_PUTS, (bus.FORGED_CLOCKS, bus.NONSENSE), strict=True):
        rows.append([name, promise, _judged(finish(bus.attacked(puts), out=None))])
    for fault in _FAULTS:
        acts = [(at_s, verdict.send(number, *names)) for at_s, number, names in fault.signals]
        _, summary = verdict.run(verdict.scenario(*fault.keys), *acts, respawn=fault.respawn)
        rows.append([fault.name, fault.promise, _judged(summary)])
    return rows


def _judged(summary: Mapping[str, Any]) -> str:
    """What the result says of itself; what this machine alone took is not asked."""
    reasons = [why for why in summary["invalid_because"] if not any(word in why for word in _MACHINES_OWN)]
    silent = sum(why.startswith("no report of") for why in reasons)
    reasons = [why for why in reasons if not why.startswith("no report of")]
    reasons += [f"no report of {silent} processes"] if silent else []
    refused = ", ".join(f"{count} x {why}" for why, count in summary["heard"]["why"].items())
    said = ["aborted" if summary["aborted"] else "ran to its end"]
    said += [f"refused: {refused}"] if refused else []
    said += [f"not valid: {'; '.join(reasons)}"] if reasons else []
    return ", ".join(said)


_MACHINES_OWN: Final = ("too late", "lost on the bus")
"""Words of reasons that a busy machine brings about by itself."""
_PUTS: Final = (
    ("a clock that is stopped, or runs 50 times as fast", "only its keeper's answer counts"),
    ("traces, reports and telemetry of others, or that make no sense", "refused and counted"),
)


class _Fault(NamedTuple):
    """Signals to processes of a swarm, at instants of swarm time [s]."""

    name: str
    promise: str
    keys: tuple[str, ...]
    signals: tuple[tuple[float, Signals, tuple[str, ...]], ...]
    respawn: bool = False


_FAULTS: Final = (
    _Fault(
        "all agents are killed", "named; never valid", (),
        ((1.5, Signals.SIGKILL, tuple(f"agent-{node}" for node in range(1, 10))),),
    ),
    _Fault(
        "the emulator is killed and started again", "what nobody knows of is unaccounted for; never valid",
        ("duration_s=8",), ((1.5, Signals.SIGKILL, ("emulator",)),), respawn=True,
    ),
    _Fault(
        "the world is killed and started again", "it goes on where it was; never valid",
        ("duration_s=8", "mobility.model=formation"), ((4.0, Signals.SIGKILL, ("world",)),), respawn=True,
    ),
    _Fault(
        "the world stands still for 5 s", "named with its standstill; never valid",
        ("duration_s=7.5", "mobility.model=formation"),
        ((1.0, Signals.SIGSTOP, ("world",)), (6.0, Signals.SIGCONT, ("world",))),
    ),
    _Fault(
        "an agent stands still to the end", "no last report; never valid", (), ((2.0, Signals.SIGSTOP, ("agent-4",)),)
    ),
)  # fmt: skip
