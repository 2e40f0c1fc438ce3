"""Rescues in small, of seconds of CPU: flown with rotors, wind and batteries, by ear, and over rubble."""

import statistics
from collections.abc import Mapping, Sequence
from typing import Final

from tests.tables.kept import Kept, Run, codes
from tests.tables.markdown import Rows
from tests.tables.missions import Case, all_flown, flown

_SMALL: Final = (
    "nodes.count=12", "nodes.spacing_m=100", "nodes.telemetry_hz=0", "traffic.interval_s=4", "world.area_m=500",
    "mission.survivors=6",
)  # fmt: skip
"""`rescue` over a twenty-fifth of its area."""
_SEEDS: Final = (1, 2, 3)
_BATTERY: Final = (*_SMALL, "duration_s=110", "sensors.battery_hz=1")
_ROTORS: Final = (*_BATTERY, 'world.engine="rotors"')
_GUSTS: Final = (*_ROTORS, "world.wind_m_s=[4, 0]", "world.gusts_m_s=8")
ENGINES: Final[Mapping[str, Case]] = {
    "`kinematic`": Case("rescue", _BATTERY, _SEEDS),
    "`rotors`, still air": Case("rescue", _ROTORS, _SEEDS),
    "`rotors`, wind of 4 m/s with gusts of 8 m/s": Case("rescue", _GUSTS, _SEEDS),
    "the same, batteries charged to 18 to 60 %": Case("rescue", (*_GUSTS, "world.charge=[0.18, 0.6]"), _SEEDS),
}
_RUBBLE: Final = (*_SMALL, "duration_s=330", "mission.buried=0.5", "sensors.voice_hz=2")
SENSES: Final[Mapping[str, Case]] = {
    "nobody | voices alone | 65 m, lines": Case(
        "rescue", (*_SMALL, "duration_s=240", "sensors.camera_hz=0", "sensors.voice_hz=2"), _SEEDS
    ),
    "half | camera and voices | 65 m, lines": Case("rescue", _RUBBLE, _SEEDS),
    "half | camera and voices | 20 m, spiral, `mission.rubble_db=20`": Case(
        "rescue", (*_RUBBLE, "nodes.altitude_m=20", "mission.rubble_db=20", "mission.search=spiral"), _SEEDS
    ),
}


def senses(kept: Kept | None = None) -> Rows:
    """The same rescue by ear alone, and with half of the survivors under rubble, from high up and from low down."""
    kept = all_flown(SENSES, kept)
    head = [
        "buried", "people are seen by", "searched from", "seeds", "detected", "confirmed", "last find [s]", "contacts",
        "buried: detected", "buried: confirmed", "buried: last estimate off by [m], median", "area covered", "code",
    ]  # fmt: skip
    return [head, *([*name.split(" | "), *_sense_cells(flown(case, kept))] for name, case in SENSES.items())]


def _sense_cells(runs: Sequence[Run]) -> list[str]:
    buried = sum(run["buried"] for run in runs)
    off_m = [off_m for run in runs for off_m in run["buried_off_m"]]
    return [
        *_found(runs),
        f"{sum(run['buried_detected'] for run in runs)} of {buried}" if buried else "-",
        f"{sum(run['buried_confirmed'] for run in runs)} of {buried}" if buried else "-",
        f"{statistics.median(off_m):.0f}" if off_m else "-",
        f"{statistics.fmean(run['coverage'] for run in runs):.2f}",
        codes(runs),
    ]


def engines(kept: Kept | None = None) -> Rows:
    """The same rescue with the fast model, with rotors, in gusts, and with batteries that are nearly empty."""
    kept = all_flown(ENGINES, kept)
    head = [
        "flown with", "seeds", "detected", "confirmed", "last find [s]", "contacts", "nearest UAV [m]",
        "least charge at the end [%]", "landed early / fell", "code",
    ]  # fmt: skip
    return [head, *([name, *_engine_cells(flown(case, kept))] for name, case in ENGINES.items())]


def _engine_cells(runs: Sequence[Run]) -> list[str]:
    return [
        *_found(runs),
        f"{min(run['nearest_m']['least'] for run in runs):.1f}",
        f"{100 * min(run['least_charge'] for run in runs):.0f}",
        f"{sum(run['landed'] for run in runs)} / {sum(run['fell'] for run in runs)}",
        codes(runs),
    ]


def _found(runs: Sequence[Run]) -> list[str]:
    """How many seeds; whom they found and confirmed, when the last of them; and contacts."""
    everyone = sum(run["survivors"] for run in runs)
    last_s = [max(run["time_to_confirm_s"], default=None) for run in runs]
    known_s = [instant_s for instant_s in last_s if instant_s is not None]
    return [
        f"{len(runs)}",
        f"{sum(run['detected'] for run in runs)} of {everyone}",
        f"{sum(run['confirmed'] for run in runs)} of {everyone}",
        f"{statistics.median(known_s):.0f}" if known_s else "-",
        f"{sum(run['collisions'] for run in runs)}",
    ]
