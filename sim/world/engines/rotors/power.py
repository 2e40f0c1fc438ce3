"""What flying costs: mechanical power of a rotor by momentum theory, and electrical power of a vehicle.

    induced velocity   v_i = v_h^2 / sqrt(V_xy^2 + (V_z + v_i)^2),  v_h^2 = T / (2 rho A)       (Glauert)
    induced power      1.15 T v_i;  climbing takes T V_z more
    profile power      (k_m k_f w^3 - 1.15 T0 v_h0) (1 + 4.65 mu^2),  mu = V_xy / (w R);  T0, v_h0: in still air
    electrical power   sum over rotors / drive efficiency + avionics

The profile power is what the measured torque in still air leaves beside the induced power, and grows with the
advance ratio (Bramwell, Helicopter Dynamics, 2nd ed., 2001). Leishman, Principles of Helicopter Aerodynamics, 2006,
for the rest. V_z is the air's velocity through the rotor from above: positive in a climb. Not modeled: the vortex
ring state of a fast descent, where the rotor is taken to need what it needs in hover.
"""

import math
from typing import Final

import numpy as np

from sim.world.arrays import Values
from sim.world.engines.contract import GRAVITY_M_S2
from sim.world.engines.rotors.vehicle_types import AIR_KG_M3, Vehicle

INDUCED_LOSS: Final = 1.15
_PROFILE_GROWTH: Final = 4.65
_ROUNDS: Final = 12
_HALVINGS: Final = 50
_FASTEST_M_S: Final = 60.0


def induced_m_s(thrust_n: Values, across_m_s: Values, through_m_s: Values, *, disc_m2: float) -> Values:
    """Glauert's induced velocity, by a damped fixed-point iteration; descents are taken as hover."""
    hover2 = np.maximum(thrust_n, 0.0) / (2 * AIR_KG_M3 * disc_m2)
    through = np.maximum(through_m_s, 0.0)
    found = np.sqrt(hover2)
    for _ in range(_ROUNDS):
        found = 0.5 * (found + hover2 / np.maximum(np.sqrt(across_m_s**2 + (through + found) ** 2), 1e-9))
    return np.asarray(found)


def rotor_power_w(vehicle: Vehicle, speed_rad_s: Values, thrust_n: Values, across: Values, through: Values) -> Values:
    disc = math.pi * vehicle.rotor_radius_m**2
    still_n = vehicle.thrust_n_s2 * speed_rad_s**2
    still_v = np.sqrt(still_n / (2 * AIR_KG_M3 * disc))
    profile = np.maximum(vehicle.torque_m * still_n * speed_rad_s - INDUCED_LOSS * still_n * still_v, 0.0)
    mu = across / np.maximum(speed_rad_s * vehicle.rotor_radius_m, 1.0)
    induced = INDUCED_LOSS * thrust_n * induced_m_s(thrust_n, across, through, disc_m2=disc)
    return np.asarray(induced + thrust_n * np.maximum(through, 0.0) + profile * (1 + _PROFILE_GROWTH * mu**2))


def electrical_w(vehicle: Vehicle, mechanical_w: Values) -> Values:
    return np.asarray(mechanical_w / vehicle.drive_efficiency + vehicle.avionics_w)


def trimmed_w(vehicle: Vehicle, airspeed_m_s: Values, climb_m_s: Values) -> Values:
    """Electrical power in steady flight: the lean at which the forces across the body balance, by bisection."""
    speed = np.minimum(np.asarray(airspeed_m_s, dtype=np.float64), _FASTEST_M_S)
    weight_n = vehicle.mass_kg * GRAVITY_M_S2
    frame = vehicle.frame_drag_kg_m * np.hypot(speed, climb_m_s)

    def balance(lean: Values) -> tuple[Values, Values, Values, Values]:
        """Rotor speed, thrust of a rotor, the air's velocity through it, and the force that is missing across it."""
        through = speed * np.sin(lean) + climb_m_s * np.cos(lean)
        across = speed * np.cos(lean) - climb_m_s * np.sin(lean)
        thrust_n = (weight_n * np.cos(lean) + frame * through) / 4
        inflow = vehicle.inflow_n_s2_m * through
        root = np.sqrt(np.maximum(inflow**2 + 4 * vehicle.thrust_n_s2 * thrust_n, 0.0))
        rotor = np.maximum(inflow + root, 0.0) / (2 * vehicle.thrust_n_s2)
        missing_n = weight_n * np.sin(lean) - (4 * vehicle.rotor_drag_n_s2_m * rotor + frame) * across
        return rotor, thrust_n, through, missing_n

    least, most = np.full_like(speed, -math.pi / 2), np.full_like(speed, math.pi / 2)
    for _ in range(_HALVINGS):
        lean = (least + most) / 2
        enough = balance(lean)[3] >= 0
        least, most = np.where(enough, least, lean), np.where(enough, lean, most)
    rotor, thrust_n, through, _ = balance(most)
    across = np.abs(speed * np.cos(most) - climb_m_s * np.sin(most))
    return electrical_w(vehicle, 4 * rotor_power_w(vehicle, rotor, thrust_n, across, through))
