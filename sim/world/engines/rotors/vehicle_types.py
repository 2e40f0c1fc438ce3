"""The types of vehicles: their parameters, with the sources; `rigid_body.py` applies them. Body axes: x ahead, y to the
left, z up.

    thrust of a rotor    k_f w^2 - k_z w V_z          w: its speed, V_z: the air's velocity through it from above
    torque of a rotor    k_m (thrust)                 against its spin
    drag                 lambda (sum of w) V_xy + c |V| V

The rotor drag, which grows with airspeed and rotor speed, is that of Martin and Salaun (ICRA 2010); c is the drag of
the frame.
"""

import math
from typing import Final, NamedTuple

from sim.world.engines.contract import GRAVITY_M_S2

AIR_KG_M3: Final = 1.225


class Cell(NamedTuple):
    """The battery of a type of vehicle."""

    cells: int
    capacity_ah: float
    resistance_ohm: float
    """The resistance of all cells in series."""


class Vehicle(NamedTuple):
    """Parameters of a multirotor with four rotors."""

    name: str
    mass_kg: float
    inertia_kg_m2: tuple[float, float, float]
    rotors_m: tuple[tuple[float, float], ...]
    """x and y of each rotor."""
    spins: tuple[int, ...]
    """+1 if the rotor turns clockwise seen from above, so that its torque turns the body counterclockwise."""
    rotor_radius_m: float
    thrust_n_s2: float
    """k_f."""
    torque_m: float
    """k_m: torque over thrust."""
    inflow_n_s2_m: float
    """k_z."""
    rotor_drag_n_s2_m: float
    """lambda."""
    frame_drag_kg_m: float
    """c."""
    max_rad_s: float
    motor_up_s: float
    """Time constant of a rotor that speeds up."""
    motor_down_s: float
    lead: float
    """A motor is driven beyond a wanted change by this share, so that it follows 1 + lead times as fast."""
    drive_efficiency: float
    """Mechanical power of the rotors over electrical power of the motors."""
    avionics_w: float
    battery: Cell
    tilt_deg: float
    """The tilt limit of the flight control."""
    rate_per_s: float
    """The gain of the rate loop; each loop outside of it is about three times slower."""

    @property
    def reach_m(self) -> float:
        """How far the tips of the blades reach: the radius of the sphere with which the vehicle touches things."""
        return max(math.hypot(x, y) for x, y in self.rotors_m) + self.rotor_radius_m


IRIS: Final = Vehicle(
    # Mass, inertia, arms and motors: RotorS (ETH Zurich), rotors_description/urdf/iris.xacro. PX4's model began as this
    # one and has other motors since (5.84e-6, up to 1100 rad/s). Propellers of 10 inches (RotorS draws 0.1 m); 3 cells
    # of 5.1 Ah: 3D Robotics, Iris+ specification (16 to 22 min of flight at 1.28 kg). Frame: its width and height
    # there, 0.47 m x 0.11 m, with a drag coefficient of 0.5 (assumed). Efficiency of motors and controllers: 0.85
    # (assumed). k_z is not published and taken as 0.
    name="iris", mass_kg=1.5, inertia_kg_m2=(0.0347563, 0.0458929, 0.0977),
    rotors_m=((0.13, -0.22), (-0.13, 0.20), (0.13, 0.22), (-0.13, -0.20)), spins=(-1, -1, 1, 1),
    rotor_radius_m=0.127, thrust_n_s2=8.54858e-6, torque_m=0.016, inflow_n_s2_m=0.0, rotor_drag_n_s2_m=8.06428e-5,
    frame_drag_kg_m=0.0158, max_rad_s=838.0, motor_up_s=0.0125, motor_down_s=0.025, lead=0.0, drive_efficiency=0.85,
    avionics_w=4.0, battery=Cell(cells=3, capacity_ah=5.1, resistance_ohm=0.03), tilt_deg=35.0, rate_per_s=18.0,
)  # fmt: skip
CRAZYFLIE: Final = Vehicle(
    # Mass, inertia, rotors, motor lag: RotorPy (University of Pennsylvania), vehicles/crazyflie_params.py; torque over
    # thrust, 0.034 there: Forster, "System Identification of the Crazyflie 2.0 Nano Quadrocopter", ETH, 2015. Battery
    # and time of flight (0.24 Ah, 7 min): Bitcraze, Crazyflie 2.0. The efficiency of the brushed motors is what gives
    # that time. Frame: 12 cm2 of board, battery and motors (Bitcraze, assumed outline) with 1.17, the drag coefficient
    # of a flat plate (Hoerner, Fluid-Dynamic Drag, 1965).
    name="crazyflie", mass_kg=0.030, inertia_kg_m2=(1.43e-5, 1.43e-5, 2.89e-5),
    rotors_m=((0.0304, 0.0304), (0.0304, -0.0304), (-0.0304, -0.0304), (-0.0304, 0.0304)), spins=(1, -1, 1, -1),
    rotor_radius_m=0.0231, thrust_n_s2=2.3e-8, torque_m=0.00596, inflow_n_s2_m=7.553e-7, rotor_drag_n_s2_m=1.02506e-6,
    frame_drag_kg_m=0.00086, max_rad_s=2500.0, motor_up_s=0.072, motor_down_s=0.072, lead=3.0, drive_efficiency=0.44,
    avionics_w=0.4, battery=Cell(cells=1, capacity_ah=0.24, resistance_ohm=0.12), tilt_deg=30.0, rate_per_s=20.0,
)  # fmt: skip
VEHICLES: Final = {vehicle.name: vehicle for vehicle in (IRIS, CRAZYFLIE)}


def hover_rad_s(vehicle: Vehicle) -> float:
    """Speed of each rotor that carries the weight in still air."""
    return float((vehicle.mass_kg * GRAVITY_M_S2 / (4 * vehicle.thrust_n_s2)) ** 0.5)
