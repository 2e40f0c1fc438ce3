"""What of ground stations the post puts on the air."""

from typing import Any

from agents.ground.operator_relay import OperatorRelay
from fanet_mw.mavlink import common
from fanet_mw.units import S


class Air:
    """Keeps by whom what is sent was said."""

    def __init__(self) -> None:
        self.systems: list[int] = []

    def send(self, data: bytes, **_: object) -> None:
        self.systems.append(data[5])


def heartbeat(system: int) -> bytes:
    mav = common.MAVLink(None, srcSystem=system, srcComponent=190)
    return bytes(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(mav))


def test_ground_stations_that_have_gone_keep_no_later_one_from_being_told(make_scenario: Any) -> None:
    relay, air = OperatorRelay(make_scenario(**{"nodes.count": 3, "ground.at_m": (0.0, -150.0)})), Air()
    relay.port = air  # type: ignore[assignment]
    for now_ns, systems in ((0, range(201, 212)), (S, range(201, 209)), (60 * S, (240,)), (61 * S, (240,))):
        for system in systems:
            relay.on_operator(heartbeat(system), now_ns)
    assert air.systems == [*range(201, 209), 240], "as many as eight in two seconds, and each once"
