"""A greeting and its answer between two nodes of a swarm in virtual time: pytest test_greeting.py"""

import pytest


@pytest.mark.asyncio
async def test_a_greeting_is_answered_although_a_node_has_failed(swarm) -> None:
    async with swarm("quick", overrides=["duration_s=40", "world.engine=kinematic"]) as s:
        one, three = s.node(1), s.node(3)
        s.cut(9)
        assert (await one.send(b"hello", port=7, to=3)).ok
        greeting = await three.receive()
        await three.send(b"welcome", port=7, to=greeting.origin)
        assert (await one.receive()).data == b"welcome"
        s.assert_ledger_closes()
