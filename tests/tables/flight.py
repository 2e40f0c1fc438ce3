"""How the vehicles fly: step response, hover in gusts, figure of eight, power; the table of docs/results/flight.md."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sim.world.arrays import Rows, Values
from sim.world.engines.battery_drain import Batteries
from sim.world.engines.contract import Engine
from sim.world.engines.kinematic import Kinematic
from sim.world.engines.rotors.power import trimmed_w
from sim.world.engines.rotors.rigid_body import Rotors
from sim.world.engines.rotors.vehicle_types import CRAZYFLIE, IRIS, Vehicle
from sim.world.environment.wind import Wind
from tests.tables.markdown import Rows as TableRows

STEP_S = 0.05
GAIN = 0.8
"""Of the position loop, as in guidance."""
GUSTS = 40
"""UAVs that hover in the gusts at once."""


class Trial(NamedTuple):
    """What a vehicle is asked to do: for a small one all is smaller."""

    vehicle: Vehicle
    step_m_s: float
    mean_wind_m_s: float
    w20_m_s: float
    eight_m: float
    """Half the width of the figure of eight; it is a quarter as high."""
    round_s: float
    published_min: str
    published_range_min: tuple[float, float]
    """The same as figures, at this mass."""
    published_kj_km: float | None = None
    """What was measured in flight on another vehicle, scaled to this mass."""


TRIALS = (
    Trial(IRIS, 5.0, 5.0, 8.0, 40.0, 32.0, "16 to 22 at 1.28 kg, so 12.6 to 17.4 at 1.5 kg", (12.6, 17.4), 21.5),
    Trial(CRAZYFLIE, 2.0, 2.0, 3.0, 4.0, 16.0, "7", (7.0, 7.0)),
)


def flown(engine: Engine, wanted: Callable[[float, Rows], Rows], seconds: float) -> tuple[Values, Values]:
    """Positions and velocities of all, every 50 ms [steps, UAVs, 3]."""
    places, speeds = [], []
    for step in range(round(seconds / STEP_S)):
        engine.advance(STEP_S, wanted(step * STEP_S, engine.positions()))
        places.append(engine.positions().copy())
        speeds.append(engine.velocities().copy())
    return np.array(places), np.array(speeds)


def stepped(trial: Trial, engine: Engine, axis: int, size: float) -> Values:
    """The velocity along an axis after a step of what is wanted, from hover; 6 s."""
    wanted = np.zeros((1, 3))
    wanted[0, axis] = size
    engine.reset(np.array([[0.0, 0.0, 50.0]]))
    return flown(engine, lambda _t, _at: wanted, 6.0)[1][:, 0, axis]


def in_gusts(trial: Trial, seconds: float = 60.0) -> Values:
    """How far each of many UAVs is from its place, in a mean wind with gusts [steps, UAVs, 3]; 10 s to lean first."""
    wind = Wind(np.random.default_rng(1), GUSTS, mean_m_s=(trial.mean_wind_m_s, 0.0), w20_m_s=trial.w20_m_s)
    home = np.array([[1000.0 * i, 0.0, 50.0] for i in range(GUSTS)])
    engine = Rotors(trial.vehicle, wind=wind)
    engine.reset(home)
    places, _ = flown(engine, lambda _t, at: GAIN * (home - at), seconds + 10.0)
    return places[round(10.0 / STEP_S) :] - home


def eight(trial: Trial, t_s: Values) -> Values:
    """The point to be followed, on a lemniscate 50 m up."""
    angle = 2 * math.pi / trial.round_s * np.asarray(t_s)
    return np.stack(
        [trial.eight_m * np.sin(angle), trial.eight_m / 2 * np.sin(2 * angle), np.full_like(angle, 50.0)], axis=-1
    )


def around(trial: Trial, engine: Engine) -> tuple[Values, Values]:
    """The way flown around the figure of eight, twice, and the one that was wanted; the second round."""
    engine.reset(np.array([[0.0, 0.0, 50.0]]))
    ahead_s = 1e-3

    def wanted(t_s: float, at: Rows) -> Rows:
        now, soon = eight(trial, np.array([t_s])), eight(trial, np.array([t_s + ahead_s]))
        return np.asarray((soon - now) / ahead_s + GAIN * (now - at))

    places, _ = flown(engine, wanted, 2 * trial.round_s)
    second = round(trial.round_s / STEP_S)
    times = STEP_S * (1 + np.arange(len(places)))
    return places[second:, 0], eight(trial, times)[second:]


def endurance_min(vehicle: Vehicle, reserve: float) -> float:
    """Minutes of hover until this share of the charge is left."""
    battery, power_w, minutes = (
        Batteries(vehicle.battery, np.ones(1)),
        trimmed_w(vehicle, np.zeros(1), np.zeros(1)),
        0.0,
    )
    while battery.charge[0] > reserve:
        battery.drain(power_w, 3.0)
        minutes += 0.05
    return minutes


def measured() -> TableRows:
    """One column per vehicle."""
    rows = [
        ["90 % of a velocity step [s]"], ["overshoot of it [%]"], ["90 % of a climb of 2 m/s [s]"],
        ["off its place in gusts, RMS [m]"], ["off its place in gusts, worst [m]"],
        ["off the figure of eight, RMS [m]"],
        ["rotors minus the fast model, RMS [m]"], ["hover [W]"], ["endurance to 20 % / to empty [min]"],
        ["endurance, published [min]"], ["energy at 5 / 10 m/s [kJ/km]"], ["least energy [kJ/km], at [m/s]"],
    ]  # fmt: skip
    for trial in TRIALS:
        vehicle = trial.vehicle
        step, climb = (stepped(trial, Rotors(vehicle), axis, size) for axis, size in ((0, trial.step_m_s), (2, 2.0)))
        off = np.linalg.norm(in_gusts(trial), axis=2)
        full, wanted = around(trial, Rotors(vehicle))
        fast, _ = around(trial, Kinematic())
        speeds = np.arange(1.0, 20.1, 0.5)
        per_km = trimmed_w(vehicle, speeds, np.zeros_like(speeds)) / speeds
        best = int(per_km.argmin())
        cells = [
            f"{STEP_S * (1 + np.argmax(step >= 0.9 * trial.step_m_s)):.2f}",
            f"{100 * max(0.0, step.max() / trial.step_m_s - 1):.1f}",
            f"{STEP_S * (1 + np.argmax(climb >= 1.8)):.2f}",
            f"{np.sqrt((off**2).mean()):.2f}",
            f"{off.max():.2f}",
            f"{np.sqrt(((full - wanted) ** 2).sum(axis=1).mean()):.2f}",
            f"{np.sqrt(((full - fast) ** 2).sum(axis=1).mean()):.2f}",
            f"{trimmed_w(vehicle, np.zeros(1), np.zeros(1))[0]:.1f}",
            f"{endurance_min(vehicle, 0.2):.1f} / {endurance_min(vehicle, 0.0):.1f}",
            trial.published_min,
            f"{per_km[speeds == 5.0][0]:.2f} / {per_km[speeds == 10.0][0]:.2f}",
            f"{per_km[best]:.2f}, {speeds[best]:.1f}",
        ]
        for row, cell in zip(rows, cells, strict=True):
            row.append(cell)
    return [["", *(trial.vehicle.name for trial in TRIALS)], *rows]
