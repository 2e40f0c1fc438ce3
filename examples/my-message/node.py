"""Be node 1 of a running swarm, greet node 3, and print what others say: python node.py SCENARIO.toml"""

import asyncio
import sys

import fanet_mw


async def main(scenario: str, endpoint: str = "tcp/127.0.0.1:7447") -> None:
    async with fanet_mw.join(scenario, node=1, radio=fanet_mw.Emulated(endpoint)) as node:
        print(await node.send(b"hello", port=7, to=3), flush=True)
        async for message in node:
            print(message.origin, message.data, f"{message.delay_ms:.0f} ms", flush=True)


asyncio.run(main(*sys.argv[1:]))
