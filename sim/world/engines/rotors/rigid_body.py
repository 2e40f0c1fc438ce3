"""Multirotors as rigid bodies with four rotors each, all computed at once in numpy: the engine `rotors`.

    m v' = R (sum of thrusts) z - drag - m g z          J w' = torques - w x J w          q' = q (0, w) / 2
    motors: first-order lag towards the wanted speed, faster up than down; symplectic Euler at `STEP_HZ`

The battery delivers the power that the rotors take (`power.py`); an empty one stops them. A body that reaches the
ground or a wall stops there, upright; beside a wall it may still rise or fall. One that stands with its motors off is
held by friction, which at a coefficient of 0.6 is stronger than the drag of an Iris below 23 m/s of wind. Not modeled:
ground effect, downwash on UAVs below, blade flapping, bouncing, and less speed of the rotors at less voltage.
"""

from typing import Final

import numpy as np

from sim.world.arrays import Flags, Rows, Values
from sim.world.engines.contacts import Contacts
from sim.world.engines.contract import GRAVITY_M_S2, Engine
from sim.world.engines.rotors.flight_control import (
    Drifting,
    FlightControl,
    allocation,
    body_up,
    cross,
    level_attitude,
    times,
)
from sim.world.engines.rotors.power import electrical_w, rotor_power_w
from sim.world.engines.rotors.vehicle_types import Vehicle, hover_rad_s
from sim.world.environment.layout import ON_GROUND_M
from sim.world.environment.solids import Solids
from sim.world.environment.wind import Wind

STEP_HZ: Final = 200
_DT_S: Final = 1 / STEP_HZ
_LEAST_SHARE: Final = 0.1
"""The least rotor speed in flight, as a share of the greatest: motors idle, but do not stop."""
_SINK_M_S: Final = 1.0
"""The mean speed of the fall of a few decimetres from where the motors are switched off to the ground."""
_TUMBLE_PER_S: Final = 2.0
"""The rate at which a body without power stops rotating."""


class Rotors(Engine):
    """A swarm of one type of vehicle. The state is an array for each quantity, with a column for each body."""

    name = "rotors"

    def __init__(self, vehicle: Vehicle, *, wind: Wind | None = None, solids: Solids | None = None) -> None:
        self.vehicle = vehicle
        self._wind = wind
        self._solids = solids if solids is not None and solids.any else None
        self._contacts = Contacts(vehicle.reach_m, self._solids)
        self._allocation = allocation(vehicle)
        self._inertia = np.array(vehicle.inertia_kg_m2)[:, None]
        self.reset(np.zeros((0, 3)))

    def reset(self, positions: Rows, velocities: Rows | None = None) -> None:
        count = len(positions)
        self._at = positions.T.astype(np.float64, copy=True)
        self._velocity = np.zeros((3, count)) if velocities is None else velocities.T.astype(np.float64, copy=True)
        hover = hover_rad_s(self.vehicle)
        drag = self._drag_n(self._velocity, np.full(count, 4 * hover), self._velocity)
        lift = drag + np.array([[0.0], [0.0], [self.vehicle.mass_kg * GRAVITY_M_S2]])
        self._attitude = level_attitude(lift / np.sqrt((lift**2).sum(axis=0)))
        self._rates = np.zeros((3, count))
        self._speed = np.full((4, count), hover)
        self._control = FlightControl(self.vehicle, count)
        self._air = np.zeros((3, count))
        self._power_w = np.zeros(count)
        self._dead = np.zeros(count, bool)
        self._stands = np.zeros(count, bool)
        self._drifting: Drifting | None = None
        self._left_s = 0.0
        self._contacts.reset()

    def advance(self, dt_s: float, wanted_m_s: Rows) -> None:
        if self._wind is not None:
            above = self._at[2] if self._solids is None else self._at[2] - self._solids.ground_m(self._at.T)
            self._air = np.ascontiguousarray(self._wind.advance(dt_s, above, self._velocity.T).T)
        self._left_s += dt_s
        before = self._at.T
        wanted = np.ascontiguousarray(wanted_m_s.T)
        while self._left_s >= _DT_S - 1e-9:
            self._left_s -= _DT_S
            self._step(wanted)
        self._contacts.notice(before, self._at.T)
        self._power_w = self._electrical()

    def _step(self, wanted: Values) -> None:
        vehicle, control = self.vehicle, self._control
        force = control.thrust_vector(wanted, self._velocity, _DT_S, self._drifting)
        thrust = control.rotor_thrusts(force, self._attitude, self._rates)
        self._turn_rotors(thrust)
        up = body_up(self._attitude)
        airflow = self._velocity - self._air
        through = (up * airflow).sum(axis=0)
        across = airflow - up * through
        lift = vehicle.thrust_n_s2 * self._speed**2 - vehicle.inflow_n_s2_m * self._speed * through
        np.maximum(lift, 0.0, out=lift)
        total, *torque = self._allocation @ lift
        drag = self._drag_n(across, self._speed.sum(axis=0), airflow)
        acceleration = (up * total - drag) / vehicle.mass_kg
        acceleration[2] -= GRAVITY_M_S2
        turning = (np.array(torque) - cross(self._rates, self._inertia * self._rates)) / self._inertia
        turning[:, self._dead] = -_TUMBLE_PER_S * self._rates[:, self._dead]
        before = self._at.copy()
        self._velocity = self._velocity + acceleration * _DT_S
        self._at = before + self._velocity * _DT_S
        self._rates = self._rates + turning * _DT_S
        self._turn_bodies()
        if self._stands.any():
            self._hold(before)
        self._stop(before)

    def _hold(self, before: Values) -> None:
        """Let the bodies that stand with their motors off neither slide nor turn; they sink until their legs touch."""
        rows = np.flatnonzero(self._stands)
        legs = ON_GROUND_M if self._solids is None else self._solids.surface_m(before[:, rows].T) + ON_GROUND_M
        self._at[:2, rows] = before[:2, rows]
        self._at[2, rows] = np.maximum(before[2, rows] - _SINK_M_S * _DT_S, np.minimum(legs, before[2, rows]))
        self._velocity[:, rows] = self._rates[:, rows] = self._speed[:, rows] = 0.0
        self._attitude[:, rows] = [[1.0], [0.0], [0.0], [0.0]]

    def _drag_n(self, across: Values, rotors_rad_s: Values, airflow: Values) -> Values:
        size = np.sqrt((airflow**2).sum(axis=0))
        rotors = self.vehicle.rotor_drag_n_s2_m * rotors_rad_s * across
        return np.asarray(rotors + self.vehicle.frame_drag_kg_m * size * airflow)

    def _turn_rotors(self, thrust: Values) -> None:
        vehicle = self.vehicle
        least = _LEAST_SHARE * vehicle.max_rad_s
        wanted = np.sqrt(np.maximum(thrust, 0.0) / vehicle.thrust_n_s2)
        np.clip(wanted, least, vehicle.max_rad_s, out=wanted)
        driven = np.clip(wanted + vehicle.lead * (wanted - self._speed), 0.0, 1.2 * vehicle.max_rad_s)
        driven[:, self._dead] = 0.0
        slow = np.where(driven > self._speed, _DT_S / vehicle.motor_up_s, _DT_S / vehicle.motor_down_s)
        self._speed = self._speed + (1 - np.exp(-slow)) * (driven - self._speed)
        np.minimum(self._speed, vehicle.max_rad_s, out=self._speed)

    def _turn_bodies(self) -> None:
        half = np.concatenate([np.zeros_like(self._rates[:1]), 0.5 * _DT_S * self._rates])
        attitude = self._attitude + times(self._attitude, half)
        self._attitude = attitude / np.sqrt((attitude**2).sum(axis=0))

    def _stop(self, before: Values) -> None:
        if self._solids is None:
            inside = self._at[2] < 0
            self._at[2, inside] = 0.0
            self._velocity[:, inside] = 0.0
        else:
            after, velocity = np.ascontiguousarray(self._at.T), np.ascontiguousarray(self._velocity.T)
            inside = self._solids.stop(before.T, after, velocity)
            self._at, self._velocity = np.ascontiguousarray(after.T), np.ascontiguousarray(velocity.T)
        if not inside.any():
            return
        self._rates[:, inside] = 0.0
        self._attitude[:, inside] = [[1.0], [0.0], [0.0], [0.0]]

    def _electrical(self) -> Values:
        """The power that the batteries deliver now, computed 20 times a second."""
        up, airflow, vehicle = body_up(self._attitude), self._velocity - self._air, self.vehicle
        through = (up * airflow).sum(axis=0)
        across = np.sqrt(((airflow - up * through) ** 2).sum(axis=0))
        lift = np.maximum((vehicle.thrust_n_s2 * self._speed - vehicle.inflow_n_s2_m * through) * self._speed, 0.0)
        mechanical = rotor_power_w(vehicle, self._speed, lift, across, through).sum(axis=0)
        return np.where(self._dead, 0.0, electrical_w(self.vehicle, mechanical))

    def stand(self, rows: Flags) -> None:
        self._control.restart(self._stands & ~rows)
        self._stands = rows

    def drift(self, rows: Flags, tilt_m_s2: Rows) -> None:
        found = np.flatnonzero(rows)
        self._drifting = Drifting(found, tilt_m_s2[found, :2].T) if len(found) else None

    def fall(self, row: int) -> None:
        self._dead[row] = True

    def positions(self) -> Rows:
        return np.ascontiguousarray(self._at.T)

    def velocities(self) -> Rows:
        return np.ascontiguousarray(self._velocity.T)

    def tilts_rad(self) -> Values:
        """The angle between each body's axis and the vertical."""
        return np.asarray(np.arccos(np.clip(body_up(self._attitude)[2], -1.0, 1.0)))

    def power_w(self) -> Values:
        return self._power_w

    def air_m_s(self) -> Rows:
        return self._air.T
