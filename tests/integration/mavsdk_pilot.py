"""Flies one UAV of a swarm with MAVSDK, as its user would, and says what came of each step; a process of its own.

python mavsdk_pilot.py URL SYSTEMS [--light | SYSTEM]
"""

import math
import sys
import time
from collections.abc import Callable
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action.action import Action
from mavsdk.plugins.info.info import Info, InfoError
from mavsdk.plugins.mission.mission import Mission, MissionItem, MissionPlan
from mavsdk.plugins.offboard.offboard import Offboard, VelocityNedYaw
from mavsdk.plugins.param.param import Param
from mavsdk.plugins.telemetry.telemetry import Telemetry


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def until(what: str, holds: Callable[[], bool], seconds: float = 60.0) -> None:
    end_s = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > end_s:
            raise SystemExit(f"not within {seconds:g} s: {what}")
        time.sleep(0.05)
    say(f"  {what}")


def item(latitude_deg: float, longitude_deg: float, height_m: float) -> MissionItem:
    nothing = math.nan
    return MissionItem(
        latitude_deg=latitude_deg, longitude_deg=longitude_deg, relative_altitude_m=height_m, speed_m_s=9.0,
        is_fly_through=True, gimbal_pitch_deg=nothing, gimbal_yaw_deg=nothing,
        camera_action=MissionItem.CameraAction.NONE, loiter_time_s=nothing, camera_photo_interval_s=nothing,
        acceptance_radius_m=nothing, yaw_deg=nothing, camera_photo_distance_m=nothing,
        vehicle_action=MissionItem.VehicleAction.NONE,
    )  # fmt: skip


def version(info: Info) -> int | None:
    """The first number of the version, once it has come."""
    try:
        return int(info.get_version().flight_sw_major)
    except InfoError:
        return None


def fly(system: Any) -> None:
    action, telemetry, param = Action(system), Telemetry(system), Param(system)
    mission, offboard = Mission(system), Offboard(system)

    def height() -> float:
        return float(telemetry.position().relative_altitude_m)

    until("telemetry.health_all_ok()", telemetry.health_all_ok)
    until("capabilities: fanet-mw 0.x", lambda: version(Info(system)) == 0)
    say("params")
    found = {entry.name: entry.value for entry in param.get_all_params().float_params}
    say(f"  get_all_params(): {', '.join(found)}")
    param.set_param_float("RTL_RETURN_ALT", 25.0)
    say(f"  RTL_RETURN_ALT {found['RTL_RETURN_ALT']:g} -> {param.get_param_float('RTL_RETURN_ALT'):g}")
    action.set_takeoff_altitude(15.0)
    say("arm, take-off")
    action.arm()
    action.takeoff()
    until("in_air, 15 m up", lambda: telemetry.in_air() and abs(height() - 15) < 2.5)
    start = telemetry.position()
    say("goto")
    north_deg = start.latitude_deg + 0.0005
    action.goto_location(north_deg, start.longitude_deg, start.absolute_altitude_m + 5, 0.0)
    until("55 m north", lambda: abs(telemetry.position().latitude_deg - north_deg) < 3e-5)
    say("offboard, 5 m/s to the south")
    offboard.set_velocity_ned(VelocityNedYaw(-5.0, 0.0, 0.0, 0.0))
    offboard.start()
    until("on its way", lambda: telemetry.velocity_ned().north_m_s < -4)
    offboard.stop()
    say("mission")
    east_deg = start.longitude_deg + 0.0005
    plan = MissionPlan([
        item(north_deg, east_deg, 20.0), item(start.latitude_deg, east_deg, 22.0),
        item(start.latitude_deg, start.longitude_deg + 0.0002, 18.0),
    ])  # fmt: skip
    mission.set_return_to_launch_after_mission(False)
    mission.upload_mission(plan)
    there = mission.download_mission().mission_items
    say(f"  uploaded {len(plan.mission_items)} items, downloaded {len(there)}")
    for sent, read in zip(plan.mission_items, there, strict=True):
        assert abs(sent.latitude_deg - read.latitude_deg) < 1e-6, (plan.mission_items, there)
        assert abs(sent.relative_altitude_m - read.relative_altitude_m) < 0.01, (plan.mission_items, there)
    mission.start_mission()
    until("item 2 of 3", lambda: mission.mission_progress().current >= 1)
    until("finished", mission.is_mission_finished)
    say("return, land")
    action.return_to_launch()
    until("on the ground", lambda: not telemetry.in_air(), 90)
    until("disarmed", lambda: not telemetry.armed())


def main(url: str, count: int, light: bool, chosen: int = 1) -> None:
    began_s = time.monotonic()
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    say(f">>> mavsdk.add_any_connection({url!r})")
    mavsdk.add_any_connection(url)
    until(f"{count} systems", lambda: mavsdk.system_count() >= count, 90)
    systems = sorted(mavsdk.get_systems(), key=lambda system: system.get_system_id())
    if not light:
        fly(systems[chosen - 1])
    else:
        for system in systems:
            assert system.has_autopilot()
            telemetry = Telemetry(system)
            name = f"system {system.get_system_id()}"
            until(f"{name}: a position", lambda of=telemetry: abs(of.position().latitude_deg) > 1, 30)
    sys.stderr.write(f"{time.monotonic() - began_s:.0f} s\n")


if __name__ == "__main__":
    light = "--light" in sys.argv
    main(sys.argv[1], int(sys.argv[2]), light, int(sys.argv[3]) if len(sys.argv) > 3 and not light else 1)
