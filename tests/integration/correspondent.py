"""An application that writes to every other node, and a program that carries it over a real radio.

python correspondent.py SCENARIO.toml NODE ADDRESS BROADCAST EPOCH    what it has got goes to stdout
"""

import asyncio
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import fanet_mw

SIZES = (0, 20, 1500)


class Correspondent(fanet_mw.Application):
    """Sends messages of several sizes to each other node and some to all, from second 3 on, and keeps what it gets."""

    name = "letters"
    ports = (5,)
    follows = (fanet_mw.Fate.ACKNOWLEDGED, fanet_mw.Fate.EXPIRED)

    def __init__(self, node: int, count: int) -> None:
        others = [fanet_mw.NodeId(other) for other in range(1, count + 1) if other != node]
        self.to_send = [(to, size) for size in SIZES for to in (*others, fanet_mw.BROADCAST)]
        self.node = node
        self.due_ns = 2_000_000_000 + node * 60_000_000
        self.got: list[tuple[int, int, str]] = []
        self.fates: list[str] = []

    def next_wake_ns(self) -> int | None:
        return self.due_ns if self.to_send else None

    def wake(self, now_ns: int) -> None:
        to, size = self.to_send.pop()
        self.due_ns += 300_000_000  # a process that began late catches up
        text = f"{self.node} to {to}: ".encode() + bytes([65 + self.node]) * size
        self.port.send(fanet_mw.Data(5, text), destination=to, confirm=True)

    def on_message(self, message: fanet_mw.Received, now_ns: int) -> None:
        self.got.append((self.node, message.origin, message.data.decode()))

    def on_status(self, status: fanet_mw.Status, now_ns: int) -> None:
        self.fates.append(status.fate)

    def report(self) -> dict[str, object]:
        return {"got": self.got, "fates": self.fates}


async def carry(scenario: str, node: str, address: str, broadcast: str, epoch: str) -> None:
    known = fanet_mw.load_scenario(Path(scenario))
    mail = Correspondent(int(node), known.nodes.count)
    radio = fanet_mw.OnAir(address, broadcast, epoch_unix_s=float(epoch))
    async with fanet_mw.join(known, node=int(node), radio=radio, applications=[mail]) as joined:
        async for _ in joined:
            pass
    sys.stdout.write(json.dumps(mail.report()))


def main(arguments: Sequence[str]) -> None:
    asyncio.run(carry(*arguments))


if __name__ == "__main__":
    main(sys.argv[1:])
