#!/usr/bin/env python
"""Draws what a ground station receives from a gateway: tracks, home, the mission's items, survivors as ADSB_VEHICLE.

fanet launch SCENARIO --mavlink udpout:127.0.0.1:14550      # and meanwhile
scripts/ground_station_map.py 14550 60 map.png              # the port, seconds, the picture
"""

import argparse
import socket
import time
from collections import defaultdict
from pathlib import Path
from typing import Any, Final

from fanet_mw.errors import MalformedFrameError
from fanet_mw.mavlink import common, decode
from sim.figures import colors
from sim.figures.style import applied, canvas, legend_above

_TEXTS: Final = 6
Place = tuple[float, float]


class Heard:
    """What came, by system."""

    def __init__(self) -> None:
        self.tracks: dict[int, list[Place]] = defaultdict(list)
        self.homes: dict[int, Place] = {}
        self.finds: dict[str, Place] = {}
        self.texts: list[str] = []
        self.messages = 0

    def take(self, message: Any) -> None:  # noqa: ANN401  (pymavlink has no types)
        self.messages += 1
        system = message.get_srcSystem()
        match message.get_type():
            case "GLOBAL_POSITION_INT" if message.lat or message.lon:
                self.tracks[system].append((message.lon / 1e7, message.lat / 1e7))
            case "HOME_POSITION":
                self.homes[system] = (message.longitude / 1e7, message.latitude / 1e7)
            case "ADSB_VEHICLE":
                self.finds[message.callsign] = (message.lon / 1e7, message.lat / 1e7)
            case "STATUSTEXT":
                self.texts.append(f"{system}: {message.text}")


def listen(port: int, seconds: float) -> Heard:
    """Be a ground station for a while."""
    heard, voice = Heard(), common.MAVLink(None, srcSystem=255, srcComponent=190)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", port))
        sock.settimeout(0.5)
        gateway, said_s, end_s = None, 0.0, time.monotonic() + seconds
        while time.monotonic() < end_s:
            if gateway is not None and time.monotonic() > said_s + 1:
                said_s = time.monotonic()
                sock.sendto(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(voice), gateway)
                voice.seq = (voice.seq + 1) % 256
            try:
                data, gateway = sock.recvfrom(65_536)
                for message in decode(data):
                    heard.take(message)
            except (TimeoutError, MalformedFrameError):
                continue
    return heard


def draw(heard: Heard, path: Path) -> None:
    with applied():
        figure, (axes,) = canvas(1, width=6.5, height=5.6)
        for index, (system, track) in enumerate(sorted(heard.tracks.items())):
            axes.plot(*zip(*track, strict=True), color=colors.BLUE, linewidth=0.9, alpha=0.7,
                      label=None if index else "GLOBAL_POSITION_INT")  # fmt: skip
            axes.plot(*track[-1], marker="o", markersize=4, color=colors.BLUE)
            axes.annotate(str(system), track[-1], textcoords="offset points", xytext=(4, 4), fontsize=8)
        if heard.homes:
            axes.scatter(*zip(*heard.homes.values(), strict=True), marker="+", color=colors.GRAY, label="HOME_POSITION")
        for index, (name, at) in enumerate(sorted(heard.finds.items())):
            axes.plot(*at, marker="D", markersize=7, color=colors.GREEN, linestyle="none",
                      label=None if index else "ADSB_VEHICLE: a survivor")  # fmt: skip
            axes.annotate(name, at, textcoords="offset points", xytext=(6, -10), fontsize=8)
        legend_above(figure, axes)
        axes.set_xlabel("longitude [degrees]")
        axes.set_ylabel("latitude [degrees]")
        axes.ticklabel_format(useOffset=False)
        figure.savefig(path, dpi=110)


def main() -> None:
    flags = argparse.ArgumentParser(description="Draws what a ground station receives from a gateway.")
    flags.add_argument("port", type=int)
    flags.add_argument("seconds", type=float)
    flags.add_argument("picture", type=Path)
    given = flags.parse_args()
    heard = listen(given.port, given.seconds)
    draw(heard, given.picture)
    print(f"{heard.messages} messages of {len(heard.tracks)} vehicles; survivors: {', '.join(sorted(heard.finds))}")
    for text in dict.fromkeys(heard.texts[-_TEXTS:]):
        print(text)


if __name__ == "__main__":
    main()
