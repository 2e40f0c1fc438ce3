"""Hosts run actors: virtual time on one heap, or real time on asyncio over Zenoh."""
