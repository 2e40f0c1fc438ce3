"""A program that only looks, with Zenoh and nothing of fanet-mw: python reader.py ENDPOINT SWARM SECONDS.

It counts the frames that each node receives, and their bytes, and prints them as JSON; Ctrl-C ends it early.
"""

import contextlib
import json
import struct
import sys
import time

import zenoh

endpoint, base, seconds = sys.argv[1], f"fanet/{sys.argv[2]}", float(sys.argv[3])
config = zenoh.Config()
for key, value in {"mode": "client", "connect/endpoints": [endpoint], "scouting/multicast/enabled": False}.items():
    config.insert_json5(key, json.dumps(value))
heard: dict[str, dict[str, float]] = {}


def on_put(sample: zenoh.Sample) -> None:
    """A put holds messages one behind the other: code, length, body."""
    data, at = sample.payload.to_bytes(), 0
    node = heard.setdefault(str(sample.key_expr).split("/")[3], {"frames": 0, "bytes": 0, "strongest_dbm": -200.0})
    while at < len(data):
        code, length = struct.unpack_from("<BI", data, at)
        if code == 2:  # Reception
            _src, _end_ns, rssi_dbm = struct.unpack_from("<Hqf", data, at + 5)
            node["frames"] += 1
            node["bytes"] += length - 14
            node["strongest_dbm"] = max(node["strongest_dbm"], rssi_dbm)
        at += 5 + length


with zenoh.open(config) as session:
    subscriber = session.declare_subscriber(f"{base}/radio/*/rx", on_put)
    with contextlib.suppress(KeyboardInterrupt):
        time.sleep(seconds)
print(json.dumps(heard, indent=2, sort_keys=True))
