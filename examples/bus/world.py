"""A world by somebody else, with Zenoh and nothing of fanet-mw: python world.py ENDPOINT SWARM.

Every node circles the origin, ten poses a second. Use it with `fanet launch SCENARIO --no-world --swarm SWARM`.
"""

import json
import math
import struct
import sys
import time

import zenoh

endpoint, base = sys.argv[1], f"fanet/{sys.argv[2]}"
config = zenoh.Config()
for key, value in {"mode": "client", "connect/endpoints": [endpoint], "scouting/multicast/enabled": False}.items():
    config.insert_json5(key, json.dumps(value))


def ask(topic: str) -> bytes:
    """The answer of the router, asked until it comes."""
    while True:
        for reply in session.get(f"{base}/{topic}"):
            if reply.ok is not None:
                return reply.ok.payload.to_bytes()
        time.sleep(0.2)


with zenoh.open(config) as session:
    scenario = json.loads(ask("scenario"))
    count, duration_s = scenario["nodes"]["count"], scenario["duration_s"]
    token = session.liveliness().declare_token(f"{base}/alive/world")
    epoch_unix_ns, scale, *_ = struct.unpack_from("<qdBqQ", ask("clock"), 5)  # after code and length
    pose = session.declare_publisher(f"{base}/world/pose")
    while (t_s := (time.time_ns() - epoch_unix_ns) / 1e9 * scale) < duration_s:
        states = []
        for node in range(count):
            angle, radius_m, rate = 2 * math.pi * node / count, 100.0, 0.05
            east, north = radius_m * math.cos(angle + rate * t_s), radius_m * math.sin(angle + rate * t_s)
            states += [east, north, 50.0, -rate * north, rate * east, 0.0]
        body = struct.pack(f"<qI{count}H{6 * count}d", round(t_s * 1e9), count, *range(1, count + 1), *states)
        pose.put(struct.pack("<BI", 4, len(body)) + body)
        time.sleep(0.1 / scale)
