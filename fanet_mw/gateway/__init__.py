"""The door between a swarm and MAVLink's ground stations: connections, and what passes between them and the bus.

It needs neither numpy nor the emulator, because the laptop beside a swarm in the field may have none of them.
"""
