"""A radar that scans all round for UAVs, walls and hillsides.

    SNR          Pt Gt Gr lambda^2 sigma T / ((4 pi)^3 R^4 k T0 F)          (the radar equation; Skolnik, 2008, ch. 1)
    P(detected)  Pfa^(1 / (1 + SNR))                                       (a Swerling 1 target, one look)
    errors       range: cell / sqrt(2 SNR);  angles: beam / (1.6 sqrt(2 SNR));  speed: lambda / (2 T) / sqrt(2 SNR)

The default SNR, 21.6 dB from 1 m2 at 100 m, is that of a 77 GHz single-chip radar: 12 dBm, 10.5 dBi each way, twelve
virtual channels, 10 ms of integration, noise figure 15 dB (Texas Instruments AWR1843). A UAV's mean cross section at 24
GHz is -8 to -19 dBsm (IEICE Communications Express 9(7), 2020: Phantom 3, 3DR Solo and others); 0.03 m2 is -15 dBsm.
The return of a target fluctuates exponentially from scan to scan (Swerling 1), and so does the SNR of each reading. The
speed is resolved to lambda / (2 T) = 0.19 m/s (77 GHz, T = 10 ms) and ambiguous by 40 m/s: 25 m/s reads as -15. UAVs
within one cell of distance, angles and speed are one echo, that of the strongest. Noise has any speed. For walls and
hillsides one ray is cast for each beam, at -10, 0 and +10 degrees, and one to the nearest place of each building, which
may stand between them; returns of the flat ground are removed by the height above ground. Noise is taken for an echo
with probability Pfa in each cell: that is the clutter. Not modeled: multiple paths, sidelobes, interference among the
swarm's radars, and targets right behind a nearer one.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from fanet_mw.bus.messages import Echo, Message, Radar
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import S
from sim.world.arrays import Rows, Values
from sim.world.environment.solids import Solids
from sim.world.sensors.contract import Sensor, Truth, angles, generator

ELEVATION_RAD: Final = math.radians(20)
"""The greatest angle up and down that a scan covers."""
RAY_ELEVATIONS_DEG: Final = (-10.0, 0.0, 10.0)
SPEED_CELL_M_S: Final = 0.19
MOST_SPEED_M_S: Final = 20.0
_BOLTZMANN: Final = 1.380649e-23
_T0_K: Final = 290.0


def radar_snr_db(
    *, power_dbm: float, gain_db: float, wavelength_m: float, seconds: float, noise_figure_db: float
) -> float:
    """The SNR of 1 m2 at 100 m by the radar equation; `gain_db` is the sum for both antennas and all channels."""
    signal = power_dbm - 30 + gain_db + 20 * math.log10(wavelength_m) - 30 * math.log10(4 * math.pi) - 80
    return signal + 10 * math.log10(seconds) - 10 * math.log10(_BOLTZMANN * _T0_K) - noise_figure_db


def detected_share(snr: Values, *, false_alarm: float) -> Values:
    """Probability that a Swerling 1 target of a mean SNR (as a ratio) is detected in one look."""
    return np.asarray(false_alarm ** (1 / (1 + snr)))


def _folded(speed_m_s: float) -> float:
    """A speed as it is read: that between the bounds which differs from it by whole ambiguities."""
    return (speed_m_s + MOST_SPEED_M_S) % (2 * MOST_SPEED_M_S) - MOST_SPEED_M_S


class RadarSensor(Sensor):
    """The radars of all UAVs, one for each."""

    kind = "radar"

    def __init__(self, scenario: Scenario, solids: Solids) -> None:
        self._config = config = scenario.sensors
        self.period_ns = round(S / config.radar_hz)
        self._beam_rad = math.radians(config.radar_beam_deg)
        self._threshold = -math.log(config.radar_false_alarm)
        beams = math.ceil(2 * math.pi / self._beam_rad)
        cells = beams * math.ceil(config.radar_range_m / config.radar_resolution_m)
        self._false_per_scan = cells * config.radar_false_alarm
        self._solids = solids
        self._rays = np.array(
            [
                [math.sin(b) * math.cos(e), math.cos(b) * math.cos(e), math.sin(e)]
                for e in map(math.radians, RAY_ELEVATIONS_DEG)
                for b in (2 * math.pi * beam / beams for beam in range(beams))
            ]
        )
        self._random = generator(scenario.seed, "radar")

    def read(self, truth: Truth, rows: Sequence[int]) -> Iterator[tuple[int, Message]]:
        for row in rows:
            echoes = [*self._uavs(truth, row), *self._walls(truth, row), *self._clutter()]
            if echoes:
                yield row, Radar(truth.now_ns, tuple(sorted(echoes)))

    def _uavs(self, truth: Truth, row: int) -> Iterator[Echo]:
        offset = truth.at - truth.at[row]
        distance = np.linalg.norm(offset, axis=1)
        found = np.flatnonzero((distance <= self._config.radar_range_m) & (distance > 0))
        found = found[np.abs(offset[found, 2]) <= math.sin(ELEVATION_RAD) * distance[found]]
        if not len(found):
            return
        if self._solids.any:
            found = found[~self._solids.blocked(np.broadcast_to(truth.at[row], (len(found), 3)), truth.at[found])]
        direction = offset[found] / distance[found][:, None]
        closing = -((truth.velocity[found] - truth.velocity[row]) * direction).sum(axis=1)
        beam_rad, range_m = self._beam_rad, self._config.radar_resolution_m
        strongest: dict[tuple[int, ...], Echo] = {}
        for index, echo in self._echoes(distance[found], direction, closing, self._config.radar_uav_m2):
            bearing, elevation = angles(direction[index])
            of = (distance[found[index]] / range_m, bearing / beam_rad, elevation / beam_rad)
            cell = tuple(math.floor(share) for share in (*of, closing[index] / SPEED_CELL_M_S))
            if cell not in strongest or echo.snr_db > strongest[cell].snr_db:
                strongest[cell] = echo
        yield from strongest.values()

    def _walls(self, truth: Truth, row: int) -> Iterator[Echo]:
        if not self._solids.any:
            return
        rays = np.vstack([self._rays, self._between_rays(truth.at[row])])
        distance = self._solids.first_hit_m(
            np.broadcast_to(truth.at[row], rays.shape), rays, self._config.radar_range_m
        )
        for aimed in range(len(self._rays), len(rays)):
            ray = int((self._rays @ rays[aimed]).argmax())
            if distance[aimed] < distance[ray]:
                rays[ray], distance[ray] = rays[aimed], distance[aimed]
        rays, distance = rays[: len(self._rays)], distance[: len(self._rays)]
        met = np.flatnonzero(np.isfinite(distance) & (distance > 0))
        closing = rays[met] @ truth.velocity[row]
        yield from (echo for _, echo in self._echoes(distance[met], rays[met], closing, self._config.radar_wall_m2))

    def _between_rays(self, at: Values) -> Rows:
        """Directions to the nearest place of each building in range, which may stand between two rays of the scan."""
        way = self._solids.nearest_walls(at) - at
        away = np.linalg.norm(way, axis=1)
        found = (away > 0) & (away <= self._config.radar_range_m)
        found &= np.abs(way[:, 2]) <= math.sin(ELEVATION_RAD) * away
        return np.asarray(way[found] / away[found, None] * (1 + 1e-9))

    def _echoes(
        self, distance: Values, direction: Values, closing: Values, area_m2: float
    ) -> Iterator[tuple[int, Echo]]:
        """The returns that exceed the threshold, with the errors of their SNR, each beside the number of its target."""
        config, random = self._config, self._random
        mean_db = config.radar_snr_db + 10 * math.log10(area_m2) - 40 * np.log10(np.maximum(distance, 1.0) / 100)
        power = (1 + 10 ** (mean_db / 10)) * random.exponential(1.0, len(distance))
        errors = random.normal(0.0, 1.0, (len(distance), 4))
        for index in np.flatnonzero(power > self._threshold).tolist():
            snr = float(power[index]) - 1
            fine = 1 / math.sqrt(2 * snr)
            bearing, elevation = angles(direction[index])
            across = self._beam_rad / 1.6 * fine
            yield (
                index,
                Echo(
                    max(0.0, float(distance[index] + errors[index, 0] * config.radar_resolution_m * fine)),
                    (bearing + float(errors[index, 1]) * across) % (2 * math.pi),
                    elevation + float(errors[index, 2]) * across,
                    _folded(float(closing[index]) + float(errors[index, 3]) * SPEED_CELL_M_S * fine),
                    10 * math.log10(snr),
                ),
            )

    def _clutter(self) -> Iterator[Echo]:
        for _ in range(int(self._random.poisson(self._false_per_scan))):
            share, bearing, elevation, speed = self._random.random(4).tolist()
            snr = self._threshold - 1 + float(self._random.exponential(1.0))  # an exponential above its threshold
            yield Echo(
                share * self._config.radar_range_m,
                2 * math.pi * bearing,
                ELEVATION_RAD * (2 * elevation - 1),
                MOST_SPEED_M_S * (2 * speed - 1),
                10 * math.log10(snr),
            )
