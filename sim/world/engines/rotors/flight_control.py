"""The nested control loops on board: velocity, attitude, rates. Positions are held by `mobility/guidance.py`.

    velocity   a = k (wanted - v) + drag(v) / m + integral, within what the tilt limit gives; thrust from a + g
    attitude   rates = 2 k_q sign(q_w) q_xyz of the quaternion error (Brescianini, Hehn and D'Andrea, ETH, 2013)
    rates      torque = J k_r (wanted - rates) + rates x J rates
    mixer      thrust and torques to the thrust of each rotor, by the inverse of the allocation matrix

drag(v) is that of still air at the rotor speed of hover, which leaves the wind to the integral. All gains follow from
the vehicle's rate gain: each loop is three times slower than the one inside it. The yaw angle is always 0, so the nose
points east. Arrays are [components, UAVs].
"""

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from sim.world.arrays import Flags, Values
from sim.world.engines.contract import GRAVITY_M_S2
from sim.world.engines.rotors.vehicle_types import Vehicle, hover_rad_s

_RATIO: Final = 3.0
"""Each loop is slower than the one inside it by this factor."""
_INTEGRAL_PER_S: Final = 0.3
_MOST_ERROR_M_S: Final = 0.5
"""Greater velocity errors count as this in the integral, which is meant for wind and drag and not for steps."""
_MOST_RATE_RAD_S: Final = 6.0
_LEAST_LIFT: Final = 0.2
"""The thrust never falls below this share of the weight, so that the vehicle can always rotate."""
_THRUST_RESERVE: Final = 0.9
"""The share of the greatest thrust that lift may take; the rest is for attitude."""
_YAW_SHARE: Final = 0.3
"""The yaw loop is slower by this factor, because yaw has only the torques of the rotors."""


class Drifting(NamedTuple):
    """Bodies whose attitude is level, but for an error by which they accelerate."""

    rows: npt.NDArray[np.intp]
    tilt_m_s2: Values
    """To the east and to the north [2, bodies]."""


class FlightControl:
    """The controllers of all UAVs of one type."""

    def __init__(self, vehicle: Vehicle, count: int) -> None:
        self._vehicle = vehicle
        self._inertia = np.array(vehicle.inertia_kg_m2)[:, None]
        rate = vehicle.rate_per_s
        self._rate_gain = np.array([rate, rate, rate * _YAW_SHARE])[:, None]
        attitude = rate / _RATIO
        self._attitude_gain = np.array([attitude, attitude, attitude * _YAW_SHARE])[:, None]
        self.velocity_per_s = attitude / _RATIO
        self._integral = np.zeros((3, count))
        self._mixer = np.linalg.inv(allocation(vehicle))
        self._max_n = 4 * vehicle.thrust_n_s2 * vehicle.max_rad_s**2
        self._tan_tilt = math.tan(math.radians(vehicle.tilt_deg))

    def restart(self, rows: Flags) -> None:
        """Forget what the loops of these UAVs have integrated while their motors were off."""
        self._integral[:, rows] = 0.0

    def thrust_vector(self, wanted: Values, velocity: Values, dt_s: float, level: Drifting | None = None) -> Values:
        """The wanted force of the rotors within the limits [N]; `level`: bodies that keep their heights alone."""
        error = wanted - velocity
        mass, gravity = self._vehicle.mass_kg, GRAVITY_M_S2
        acceleration = self.velocity_per_s * error + still_drag_m_s2(self._vehicle, velocity) + self._integral
        if level is not None:
            acceleration[:2, level.rows] = level.tilt_m_s2
        lift = np.clip(acceleration[2] + gravity, _LEAST_LIFT * gravity, _THRUST_RESERVE * self._max_n / mass)
        size = np.sqrt(acceleration[0] ** 2 + acceleration[1] ** 2)
        room = np.sqrt(np.maximum((_THRUST_RESERVE * self._max_n / mass) ** 2 - lift**2, 0.0))
        limit = np.minimum(lift * self._tan_tilt, room)
        scale = np.minimum(1.0, limit / np.maximum(size, 1e-9))
        free = scale >= 1.0  # a loop at its limit stops integrating
        grown = _INTEGRAL_PER_S * self.velocity_per_s * dt_s * np.clip(error, -_MOST_ERROR_M_S, _MOST_ERROR_M_S)
        self._integral[:2] += np.where(free, grown[:2], 0.0)
        self._integral[2] += grown[2]
        most = gravity * self._tan_tilt
        np.clip(self._integral, -most, most, out=self._integral)
        return np.asarray(mass * np.array([acceleration[0] * scale, acceleration[1] * scale, lift]))

    def rotor_thrusts(self, force: Values, attitude: Values, rates: Values) -> Values:
        """The wanted thrust of each rotor [4, UAVs], for a force at an attitude (quaternion w, x, y, z)."""
        size = np.sqrt((force**2).sum(axis=0))
        wanted = level_attitude(force / size)
        error = times(conjugate(attitude), wanted)
        target = 2 * self._attitude_gain * np.sign(error[0] + 1e-12) * error[1:]
        np.clip(target, -_MOST_RATE_RAD_S, _MOST_RATE_RAD_S, out=target)
        torque = self._inertia * self._rate_gain * (target - rates) + cross(rates, self._inertia * rates)
        # Thrust along the body's own axis lifts less while it leans elsewhere than wanted.
        along = np.maximum((body_up(attitude) * force).sum(axis=0), 0.3 * size)
        return np.asarray(self._mixer @ np.concatenate([along[None], torque]))


def still_drag_m_s2(vehicle: Vehicle, velocity: Values) -> Values:
    """What drag takes from a level vehicle at this velocity in still air [3, UAVs]."""
    speed = np.sqrt((velocity**2).sum(axis=0))
    rotors = 4 * vehicle.rotor_drag_n_s2_m * hover_rad_s(vehicle) * np.array([[1.0], [1.0], [0.0]])
    return np.asarray((rotors + vehicle.frame_drag_kg_m * speed) * velocity / vehicle.mass_kg)


def allocation(vehicle: Vehicle) -> Values:
    """Thrust and torques about x, y, z of the body, by the thrust of each rotor [4, 4]."""
    x = np.array([rotor[0] for rotor in vehicle.rotors_m])
    y = np.array([rotor[1] for rotor in vehicle.rotors_m])
    return np.array([np.ones(4), y, -x, vehicle.torque_m * np.array(vehicle.spins, dtype=np.float64)])


def level_attitude(up: Values) -> Values:
    """The attitude whose body axis z is `up` (unit vectors), reached from level by the shortest rotation."""
    w = np.sqrt(np.maximum((1 + up[2]) / 2, 1e-9))
    return np.array([w, -up[1] / (2 * w), up[0] / (2 * w), np.zeros_like(w)])


def body_up(q: Values) -> Values:
    """The body's axis z, in east, north, up."""
    w, x, y, z = q
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])


def times(a: Values, b: Values) -> Values:
    """Hamilton's product of quaternions."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return np.array(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ]
    )


def conjugate(q: Values) -> Values:
    return np.array([q[0], -q[1], -q[2], -q[3]])


def cross(a: Values, b: Values) -> Values:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
