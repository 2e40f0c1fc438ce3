"""MAVSDK's server plugins as a flight controller that flies a simple model; a process of its own.

    python mavsdk_autopilot.py URL SYSTEM

It flies what setpoints and commands ask for as a point at up to 10 m/s, and takes nothing but PX4's words.
"""

# ruff: noqa: FBT003  (MAVSDK takes its flags by position)

import json
import math
import sys
import threading
import time

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action_server.action_server import ActionServer, AllowableFlightModes, FlightMode
from mavsdk.plugins.mavlink_direct_server.mavlink_direct_server import MavlinkDirectServer
from mavsdk.plugins.telemetry_server.telemetry_server import (
    AngularVelocityBody,
    Battery,
    EulerAngle,
    FixType,
    GpsInfo,
    Heading,
    LandedState,
    Position,
    RawGps,
    TelemetryServer,
    VelocityNed,
    VtolState,
)

from fanet_mw.hosts.timebase import THIS_MACHINE

LAT, LON, GROUND_M = 37.5665, 126.978, 40.0
PER_DEG = 111_319.5
TICK_S = 0.1
YAW_DEG = 57.3


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


class Model:
    """A point that flies where it is told."""

    def __init__(self, east_m: float) -> None:
        self.east, self.north, self.up = east_m, 0.0, 0.0
        self.velocity = (0.0, 0.0, 0.0)
        self.goal: tuple[float, float, float] | None = None
        self.wish: tuple[float, float, float] | None = None
        self.armed = False
        self.mode = FlightMode.HOLD
        self.lock = threading.Lock()
        self.setpoints = 0

    def step(self) -> None:
        with self.lock:
            wish = self.wish
            if wish is None:
                goal = self.goal or (self.east, self.north, self.up)
                away = [g - h for g, h in zip(goal, (self.east, self.north, self.up), strict=True)]
                far = math.hypot(*away)
                share = min(1.0, 10.0 * TICK_S / far) / TICK_S if far else 0.0
                wish = (away[0] * share, away[1] * share, away[2] * share)
            if not self.armed:
                wish = (0.0, 0.0, 0.0)
            self.velocity = wish
            self.east += wish[0] * TICK_S
            self.north += wish[1] * TICK_S
            self.up = max(0.0, self.up + wish[2] * TICK_S)
            if self.mode is FlightMode.LAND and self.up < 0.1 and self.armed:
                self.armed = False
                say("landed")


def main(url: str, system: int, east_m: float) -> None:
    mavsdk = Mavsdk(manual(system))
    server = mavsdk.server_component()
    telemetry, action, direct = TelemetryServer(server), ActionServer(server), MavlinkDirectServer(server)
    model = Model(east_m)
    mavsdk.add_any_connection(url)

    def arm(_result: object, change: object, _data: object = None) -> None:
        model.armed = bool(change.arm)  # type: ignore[attr-defined]
        say(f"armed {model.armed}")

    def take_off(_result: object, wanted: object, _data: object = None) -> None:
        say(f"take-off {wanted}")
        with model.lock:
            model.mode, model.wish, model.goal = FlightMode.TAKEOFF, None, (model.east, model.north, 20.0)

    def mode(_result: object, wanted: object, _data: object = None) -> None:
        asked = FlightMode(wanted)  # type: ignore[arg-type]
        with model.lock:
            model.mode = asked
            if asked in (FlightMode.LAND, FlightMode.RETURN_TO_LAUNCH):
                model.wish, model.goal = None, (model.east, model.north, 0.0)
        say(f"mode {asked.name}")

    def place(message: object, _data: object = None) -> None:
        fields = json.loads(message.fields_json)  # type: ignore[attr-defined]
        model.setpoints += 1
        if model.mode is not FlightMode.OFFBOARD:
            return
        with model.lock:
            model.wish = None
            model.goal = (
                (fields["lon_int"] / 1e7 - LON) * PER_DEG * math.cos(math.radians(LAT)),
                (fields["lat_int"] / 1e7 - LAT) * PER_DEG, fields["alt"],
            )  # fmt: skip

    def velocity(message: object, _data: object = None) -> None:
        fields = json.loads(message.fields_json)  # type: ignore[attr-defined]
        model.setpoints += 1
        if model.mode is FlightMode.OFFBOARD:
            with model.lock:
                model.goal, model.wish = None, (fields["vy"], fields["vx"], -fields["vz"])

    action.set_allow_takeoff(True)
    action.set_armable(True, True)
    action.set_disarmable(True, True)
    action.set_allowable_flight_modes(AllowableFlightModes(True, True, True, True, True, True, True))
    action.subscribe_arm_disarm(arm)
    action.subscribe_takeoff(take_off)
    action.subscribe_flight_mode_change(mode)
    direct.subscribe_message("SET_POSITION_TARGET_GLOBAL_INT", place)
    direct.subscribe_message("SET_POSITION_TARGET_LOCAL_NED", velocity)
    ticks = 0
    while True:
        model.step()
        lat = LAT + model.north / PER_DEG
        lon = LON + model.east / (PER_DEG * math.cos(math.radians(LAT)))
        east, north, up = model.velocity
        telemetry.publish_position(
            Position(lat, lon, GROUND_M + model.up, model.up), VelocityNed(north, east, -up), Heading(0.0)
        )
        telemetry.publish_attitude(
            EulerAngle(math.degrees(east / 50), math.degrees(-north / 50), YAW_DEG, 0),
            AngularVelocityBody(0.0, 0.0, 0.0),
        )
        if ticks % 5 == 0:
            telemetry.publish_unix_epoch_time(THIS_MACHINE.unix_ns() // 1000)
            state = LandedState.ON_GROUND if model.up < 0.1 else LandedState.IN_AIR
            telemetry.publish_extended_sys_state(VtolState.UNDEFINED, state)
            telemetry.publish_raw_gps(
                RawGps(0, lat, lon, GROUND_M + model.up, 1.0, 1.0, 0.0, 0.0, GROUND_M, 1.0, 1.0, 0.1, 1.0, 0.0),
                GpsInfo(12, FixType.FIX_3D),
            )
            telemetry.publish_sys_status(Battery(15.2, 0.87), True, True, True, True, True)
        ticks += 1
        time.sleep(TICK_S)


def manual(system: int) -> Configuration:
    configuration = Configuration.create_with_component_type(ComponentType.AUTOPILOT)
    configuration.system_id = system
    return configuration


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]) if len(sys.argv) > 3 else 0.0)
