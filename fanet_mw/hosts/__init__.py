"""Hosts run actors: in virtual time, with one event heap for all, or in real time, with asyncio and Zenoh."""
