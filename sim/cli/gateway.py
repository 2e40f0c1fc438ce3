"""`fanet gateway`: ground stations see and command the UAVs of a swarm that runs."""

from sim.cli.options import DoorFlags, SwarmFlags
from sim.console import tell


def gateway(
    swarm: str | None = None,
    *,
    doors: DoorFlags = DoorFlags(),
    where: SwarmFlags = SwarmFlags(),
) -> int:
    """Connect ground stations (QGroundControl, MAVProxy, MAVSDK) to a swarm that runs, until it ends.

    Args:
        swarm: Name of the swarm; by default the only one running.

    """
    import asyncio

    from sim.run.gateway import run

    located = where.located(swarm)
    return asyncio.run(run(*located, doors.doors(default=True), zenoh_config=where.zenoh_config, tell=tell))
