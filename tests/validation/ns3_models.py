"""Two models of ns-3.44 by themselves, ours beside them: `python -m tests.validation.ns3_models PREFIX`.

OFDM's error rates, and Jakes' fading in time (JakesPropagationLossModel): correlation of the power of pairs at rest,
and what unicasts in seven attempts meet. What ns-3 says is kept in `ns3/`, from which tests and `scripts/tables
ns3-fading` read. PREFIX: see `tests/ns3/live.py`.
"""

import argparse
import json
import math
import statistics
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from emulator.channel import fading
from emulator.channel.error_rate import SHORT_BYTES, log_success_per_bit
from emulator.channel.path_loss import SPEED_OF_LIGHT_M_S
from emulator.kernel import state
from emulator.kernel.fading_gain import gain
from emulator.kernel.phy import ERROR_FLOOR_DB, ERROR_STEPS_PER_DB
from fanet_mw.scenario import config
from fanet_mw.units import S
from tests.ns3 import live
from tests.tables.markdown import Rows
from tests.validation.reference import at, summary_of

_KEPT: Final = Path(__file__).parent / "ns3"
ERRORS: Final = _KEPT / "ofdm_errors.txt"
JAKES: Final = _KEPT / "jakes.json"
_MODELS: Final = {"Nist": "nist", "TableBased": "tables"}
_DOPPLER_HZ: Final = 8.0
_STEP_S: Final = 0.005
_SAMPLES: Final = 200
_TURNS: Final = (0.08, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.6)
"""Lags, in parts of the period of the greatest Doppler shift."""
_DEEP: Final = 0.1
_UNICAST_HZ: Final = (2.0, 8.0, 80.0)
_MARGIN_DB: Final = 3.0
_DISTANCE_M: Final = 10 ** ((30 - 40.05 + 82 - _MARGIN_DB) / 30)
_SECONDS: Final = 60
_INTERVAL_S: Final = 0.02
_FIGURES: Final = ("pdr", "air.attempt_failure")
_SEEDS: Final = tuple(range(1, 11))
_WAVELENGTH_M: Final = SPEED_OF_LIGHT_M_S / 2412e6


class Curve(NamedTuple):
    """Shares of frames that arrive, over SINR."""

    model: str
    rate_mbps: float
    size: int
    sinr_db: np.ndarray
    arrive: np.ndarray

    @property
    def ours(self) -> np.ndarray:
        table = log_success_per_bit(self.rate_mbps, self.model, short=self.size < SHORT_BYTES)
        axis_db = ERROR_FLOOR_DB + np.arange(len(table)) / ERROR_STEPS_PER_DB
        return np.asarray(np.exp(np.interp(self.sinr_db, axis_db, table) * 8 * self.size))


def curves() -> Iterator[Curve]:
    """What ns-3 said."""
    for line in ERRORS.read_text(encoding="ascii").splitlines():
        model, rate, size, first, step, *shares = line.split()
        sinr_db = float(first) + float(step) * np.arange(len(shares))
        yield Curve(_MODELS[model], float(rate), int(size), sinr_db, np.array([float(share) for share in shares]))


def _correlations(gains: np.ndarray) -> dict[str, float]:
    off = gains - gains.mean()
    lags = [round(turns / _DOPPLER_HZ / _STEP_S) for turns in _TURNS]
    alike = [float((off[:, :-lag] * off[:, lag:]).mean() / (off**2).mean()) for lag in lags]
    return {
        "mean": float(gains.mean()),
        "deep": float((gains < _DEEP).mean()),
        **{f"{turns:g}": found for turns, found in zip(_TURNS, alike, strict=True)},
    }


def measure_ns3(prefix: Path, folder: Path) -> None:
    """Run ns-3 and keep what it says."""
    models = live.build(prefix, folder, "models")
    said = subprocess.run([str(models), "--what=errors"], check=True, capture_output=True, text=True).stdout
    ERRORS.write_text(said, encoding="ascii")
    settings = [f"--doppler={_DOPPLER_HZ}", f"--step={_STEP_S}", f"--samples={_SAMPLES}"]
    lines = subprocess.run([str(models), "--what=jakes", *settings], check=True, capture_output=True, text=True).stdout
    gains = np.array([[float(word) for word in line.split()] for line in lines.splitlines()])
    program = live.build(prefix, folder)
    unicast = {
        f"{doppler_hz:g}": [
            live.run(
                program, topology="chain", nodes=2, cast="unicast", channel="B", spacing=_DISTANCE_M,
                interval=_INTERVAL_S, duration=_SECONDS, doppler=doppler_hz, run=seed,
            )
            for seed in _SEEDS
        ]
        for doppler_hz in _UNICAST_HZ
    }  # fmt: skip
    found = {"both ways alike": bool(gains[:, -1].all()), **_correlations(gains[:, :-1]), "unicast": unicast}
    JAKES.write_text(json.dumps(found, indent=1) + "\n", encoding="ascii")


def _ours() -> dict[str, float]:
    """The same of our fading, of pairs at rest among what moves."""
    speed = _DOPPLER_HZ * _WAVELENGTH_M
    keys = {"channel": "friis", "fading": "nakagami", "nakagami_m": 1, "scatterer_speed_m_s": speed}
    radio = config.build({"clusters": {"count": 1}, "radio": keys}).radio
    p, pf, g = np.zeros(state.PARAMETERS, np.int64), np.zeros(state.REALS), np.zeros(state.GLOBALS, np.int64)
    p[state.FADING], pf[state.FADING_SHAPE] = fading.law_of(radio)
    table, random = fading.tables(radio), np.random.default_rng(36)
    instants = [round(step * _STEP_S * S) for step in range(_SAMPLES)]
    drawn = []
    for seed in range(30):
        places = random.uniform(0, 5000, (20, 3))
        waves = fading.Waves(radio, seed=seed).of(places, np.zeros((20, 3)), 0)
        drawn += [[gain(g, p, pf, waves, table, i, i + 1, t_ns) for t_ns in instants] for i in range(0, 20, 2)]
    return _correlations(np.array(drawn))


def _unicasts(doppler_hz: float) -> list[Mapping[str, Any]]:
    keys = (
        "nodes.count=2", "nodes.layout=line", f"nodes.spacing_m={_DISTANCE_M}", "radio.channel=log_distance",
        "radio.fading=nakagami", "radio.nakagami_m=1", f"radio.scatterer_speed_m_s={doppler_hz * _WAVELENGTH_M}",
        "traffic.arrivals=cbr", f"traffic.interval_s={_INTERVAL_S}", f"duration_s={_SECONDS}",
    )  # fmt: skip
    return [summary_of("contention_unicast", keys, seed) for seed in _SEEDS]


def _j0_squared(turns: float) -> float:
    angle = math.pi * (np.arange(400) + 0.5) / 400
    return float(np.cos(2 * math.pi * turns * np.cos(angle)).mean() ** 2)


def fading_table() -> Rows:
    """Fading in time, beside Jakes' of ns-3 and the law."""
    theirs, ours = json.loads(JAKES.read_text(encoding="ascii")), _ours()
    rows = [["figure", "law", "ours", "ns-3.44"]]
    rows.append(["mean power", "1", f"{ours['mean']:.2f}", f"{theirs['mean']:.2f}"])
    rows.append(["10 dB and more below the mean", f"{1 - math.exp(-_DEEP):.3f}", f"{ours['deep']:.3f}",
                 f"{theirs['deep']:.3f}"])  # fmt: skip
    for turns in _TURNS:
        name = f"{turns:g}"
        rows.append([f"correlation of the power after {name} / f_D", f"{_j0_squared(turns):.2f}", f"{ours[name]:.2f}",
                     f"{theirs[name]:.2f}"])  # fmt: skip
    for doppler_hz in _UNICAST_HZ:
        runs, said = _unicasts(doppler_hz), theirs["unicast"][f"{doppler_hz:g}"]
        name = f"unicasts 3 dB above the threshold, f_D = {doppler_hz:g} Hz"
        rows += [
            [f"{name}: `{figure}`", "", _spread([at(run, figure) for run in runs]), _spread([s[figure] for s in said])]
            for figure in _FIGURES
        ]
    return rows


def _spread(values: Sequence[float]) -> str:
    """Mean and standard error."""
    return f"{statistics.fmean(values):.3f} +- {statistics.stdev(values) / math.sqrt(len(values)):.3f}"


def main() -> None:
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("prefix", type=Path, help="folder with include/ and lib64/ of ns-3.44")
    with tempfile.TemporaryDirectory() as folder:
        measure_ns3(flags.parse_args().prefix, Path(folder))
    for curve in curves():
        off = float(np.abs(curve.ours - curve.arrive).max())
        print(f"{curve.model}, {curve.rate_mbps:g} Mb/s, {curve.size} bytes: off by at most {off:.4f}")
    print("\n".join(" | ".join(row) for row in fading_table()))


if __name__ == "__main__":
    main()
