"""The Zenoh topics of a swarm. This is the only module that knows them; the bytes on them are in `codecs.py`.

fanet/<swarm>/radio/<id>/tx          TxRequest              node -> medium
fanet/<swarm>/radio/<id>/rx          Reception | TxStatus   medium -> node
fanet/<swarm>/radio/control          Degrade | Jam | Cut | Partition | Mishap | Restore   anyone -> medium, world
fanet/<swarm>/radio/links            LinkStats              medium -> observers
fanet/<swarm>/world/pose             Poses
fanet/<swarm>/world/obstruction      Obstructions
fanet/<swarm>/world/<id>/setpoint    Setpoint               UAV -> world
fanet/<swarm>/world/<id>/sensor/gps  Gps
fanet/<swarm>/world/<id>/sensor/wifi WifiScan; camera: Camera, voice: Voice, radar: Radar, altimeter: Altimeter,
inertial: Inertial, battery: Battery, image: CameraImage, flight: FlightState, wind: WindEstimate,
pad: LandingTarget
fanet/<swarm>/mavlink/<id>           MavlinkTap             UAV -> observers, gateways
fanet/<swarm>/mavlink/<id>/in        MavlinkTap             gateway -> UAV
fanet/<swarm>/ground/order           Order                  anyone -> the post on the ground
fanet/<swarm>/trace/<id>             TraceBatch             <id> is the actor's name
fanet/<swarm>/report/<id>            Report                 <id> is the actor's name
fanet/<swarm>/clock                  Clock
fanet/<swarm>/clock/control          ClockRequest           an operator -> the keeper of the clock
"""

import re
from typing import Final

from fanet_mw.errors import ConfigError

ROOT: Final = "fanet"
ALL_SCENARIOS: Final = f"{ROOT}/*/scenario"
"""The topics of queries for the scenarios of all swarms of a router."""
_NAME: Final = re.compile(r"[^\s/*$#?]{1,128}")


class Topics:
    """The key expressions of one swarm."""

    def __init__(self, swarm: str) -> None:
        if not _NAME.fullmatch(swarm):
            raise ConfigError(
                f"the name of a swarm, {swarm!r}, is part of topics: at most 128 characters, none of / * $ # ? or space"
            )
        self.swarm = swarm
        self._base = f"{ROOT}/{swarm}"
        self.pose = f"{self._base}/world/pose"
        self.obstruction = f"{self._base}/world/obstruction"
        self.clock = f"{self._base}/clock"
        self.clock_control = f"{self._base}/clock/control"
        self.all_tx = self.radio_tx("*")
        self.radio_control = f"{self._base}/radio/control"
        self.orders = f"{self._base}/ground/order"
        self.radio_links = f"{self._base}/radio/links"
        self.all_setpoints = f"{self._base}/world/*/setpoint"
        self.all_sensors = f"{self._base}/world/*/sensor/*"
        self.images = self.sensor("*", "image")
        self.all_traces = f"{self._base}/trace/*"
        self.all_reports = f"{self._base}/report/*"
        self.all_alive = f"{self._base}/alive/**"
        self.scenario = f"{self._base}/scenario"
        """The topic of queries for the scenario; the keeper of the clock answers with the scenario as JSON."""
        self.standing = f"{self._base}/standing"
        """The topic of queries for how things stand; whoever collects answers with the trace records that say it."""

    def radio_tx(self, node: int | str) -> str:
        return f"{self._base}/radio/{node}/tx"

    def radio_rx(self, node: int | str) -> str:
        return f"{self._base}/radio/{node}/rx"

    def setpoint(self, node: int) -> str:
        return f"{self._base}/world/{node}/setpoint"

    def sensor(self, node: int | str, kind: str) -> str:
        return f"{self._base}/world/{node}/sensor/{kind}"

    def sensors(self, node: int) -> str:
        return f"{self._base}/world/{node}/sensor/*"

    def mavlink(self, node: int | str) -> str:
        return f"{self._base}/mavlink/{node}"

    def operator(self, node: int | str) -> str:
        """The topic on which a gateway hands a UAV what ground stations say to it."""
        return f"{self.mavlink(node)}/in"

    def trace(self, name: str) -> str:
        return f"{self._base}/trace/{name}"

    def report(self, name: str) -> str:
        return f"{self._base}/report/{name}"

    def alive(self, name: str, *, fingerprint: str = "", instance: str = "") -> str:
        """The liveliness token of a process: its name, its scenario, and which of several processes of that name."""
        rest = f"/{fingerprint}/{instance}" if fingerprint else ""
        return f"{self._base}/alive/{name}{rest}"


def swarm_of(topic: str) -> str:
    """The name of the swarm whose topic this is."""
    return topic.split("/")[1]


def node_of(topic: str) -> int:
    """The node id in a `radio/<id>/..` or `world/<id>/..` topic; 0 when there is none."""
    parts = topic.split("/")
    text = parts[3] if len(parts) > 3 else ""
    return int(text) if len(text) <= 5 and text.isascii() and text.isdigit() else 0  # an id has at most five digits


def node_of_tap(topic: str) -> int:
    """The node id in a `mavlink/<id>` topic; 0 when there is none."""
    text = topic.rpartition("/")[2]
    return int(text) if len(text) <= 5 and text.isascii() and text.isdigit() else 0
