"""Hosts, which run actors: in virtual time on one heap, or in real time on asyncio over Zenoh."""
