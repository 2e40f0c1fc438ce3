"""How long commands of a ground station take in real time, by the tap and in band, with 1, 9 and 45 UAVs.

    python tests/benchmarks/operator_commands.py [COMMANDS] [--uavs 1 9 45] [--ways tap in-band]

UAVs stand on the ground in a square, 100 m apart, with 220 m of range, in rounds with a lead of 60 ms. The ground
station is a UDP client that says 100 commands (arm), each once its predecessor is acknowledged or 3 s are over. A row
is printed for each swarm: heartbeats of each UAV a second, delays, and commands that were not acknowledged.
"""

import argparse
import contextlib
import math
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

from fanet_mw.errors import MalformedFrameError
from fanet_mw.mavlink import common, decode

PATIENCE_S: Final = 3.0
SETTLES_S: Final = 15.0
SWARM: Final = """
duration_s = 900
[nodes]
count = {count}
layout = "explicit"
positions_m = {places}
on_ground = true
[ground]
at_m = [0.0, 0.0]
[traffic]
arrivals = "none"
[routing]
protocol = "rounds"
[radio]
channel = "range"
range_m = 220
lead_ms = 60
handover_ms = 20
[mobility]
model = "onboard"
[world]
area_m = 4000
engine = "kinematic"
"""


class Station:
    """A ground station on a UDP port."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.05)
        self.port: int = self.socket.getsockname()[1]
        self._gateway: tuple[str, int] | None = None
        self._mav = common.MAVLink(None, srcSystem=255, srcComponent=190)
        self._beat_s = 0.0
        self.beats = 0

    def say(self, message: object) -> None:
        if self._gateway is not None:
            self.socket.sendto(bytes(message.pack(self._mav)), self._gateway)  # type: ignore[attr-defined]
            self._mav.seq = (self._mav.seq + 1) % 256

    def hear(self, until_s: float, *, ack_of: int = 0) -> bool:
        """Hear until an instant, or until a UAV acknowledges: then True."""
        while (now_s := time.monotonic()) < until_s:
            if now_s >= self._beat_s:
                self._beat_s = now_s + 1
                self.say(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
            with contextlib.suppress(TimeoutError, MalformedFrameError):
                data, self._gateway = self.socket.recvfrom(65_536)
                for message in decode(data):
                    self.beats += message.get_type() == "HEARTBEAT" and message.get_srcComponent() == 1
                    if ack_of and message.get_type() == "COMMAND_ACK" and message.get_srcSystem() == ack_of:
                        return True
        return False


def measured(count: int, way: str, commands: int) -> str:
    """A row of the table."""
    side = math.ceil(math.sqrt(count))
    places = [[100.0 + 100.0 * (n % side), 100.0 * (n // side), 0.0] for n in range(count)]
    station, took, missed = Station(), list[float](), 0
    with tempfile.TemporaryDirectory() as folder:
        scenario = Path(folder) / "commanded.toml"
        scenario.write_text(SWARM.format(count=count, places=places))
        words = ["launch", str(scenario), "--swarm", f"commanded-{os.getpid()}", f"--{way}"]
        words += ["--mavlink", f"udpout:127.0.0.1:{station.port}"]
        with subprocess.Popen(
            [sys.executable, "-m", "fanet_mw", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        ) as process:
            while station.beats < count:
                station.hear(time.monotonic() + 1)
            station.hear(time.monotonic() + SETTLES_S)
            began_s, before = time.monotonic(), station.beats
            for number in range(commands):
                said_s = time.monotonic()
                to = 1 + number % count
                station.say(common.MAVLink_command_long_message(to, 1, 400, 0, number % 2, number, 0, 0, 0, 0, 0))
                if station.hear(said_s + PATIENCE_S, ack_of=to):
                    took.append(time.monotonic() - said_s)
                else:
                    missed += 1
                station.hear(time.monotonic() + 0.2)
            rate = (station.beats - before) / count / (time.monotonic() - began_s)
            process.send_signal(signal.SIGINT)
    took.sort()
    median, most = (1000 * took[len(took) * part // 100] for part in (50, 99)) if took else (math.nan, math.nan)
    return f"| {way} | {count} | {rate:.2f} | {median:.0f} | {most:.0f} | {missed} |"


def main() -> None:
    flags = argparse.ArgumentParser(description="How long commands take in real time, by the tap and in band.")
    flags.add_argument("commands", nargs="?", type=int, default=100)
    flags.add_argument("--uavs", nargs="+", type=int, default=[1, 9, 45])
    flags.add_argument("--ways", nargs="+", choices=("tap", "in-band"), default=["tap", "in-band"])
    given = flags.parse_args()
    print(f"| way | UAVs | heartbeats of each [Hz] | median [ms] | 99 % [ms] | not acknowledged |\n|{'---|' * 6}")
    for count in given.uavs:
        for way in given.ways:
            print(measured(count, way, given.commands), flush=True)


if __name__ == "__main__":
    main()
