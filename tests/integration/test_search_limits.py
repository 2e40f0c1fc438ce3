"""An operator changes in flight when UAVs leave their search: a parameter that is set is obeyed, by that UAV alone."""

from fanet_mw.bus.messages import MavlinkTap
from fanet_mw.mavlink import common
from fanet_mw.units import S
from sim.observation.swarm_state import SwarmState
from sim.run.virtual import Observed
from sim.scenarios import catalog


def test_a_uav_whose_reserve_is_raised_above_its_charge_flies_home() -> None:
    scenario = catalog.find("rescue", [
        "nodes.count=6", "nodes.spacing_m=60", "world.area_m=500", "mission.survivors=0", "duration_s=25",
        "traffic.arrivals=none", "sensors.battery_hz=1",
    ])  # fmt: skip
    state = SwarmState(scenario)
    observed = Observed(scenario, observer=state)
    observed.host.start()
    observed.host.run(12 * S)
    assert {uav.mission for uav in state.uavs.values()} <= {"deploy", "search"}
    station = common.MAVLink(None, srcSystem=255, srcComponent=190)
    raised = common.MAVLink_param_set_message(4, 1, b"SRCH_RESERVE", 1.0, 9)
    observed.host.put(observed.names.operator(4), MavlinkTap(0, bytes(raised.pack(station))))
    observed.host.run(20 * S)
    assert [node for node, uav in state.uavs.items() if uav.mission == "return"] == [4]
