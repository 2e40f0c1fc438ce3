"""`fanet inspect` and `fanet topic`: what a swarm says, message by message."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from cyclopts.validators import Number

from sim.cli.options import RUNNING, SwarmFlags

topic = App(name="topic", group=RUNNING, help="The topics of a swarm that runs: list, echo, hz, bw.")


def inspect(what: str | None = None, *, where: SwarmFlags = SwarmFlags()) -> int:
    """Inspect what a swarm says: messages with rates and values, ways of packets, turns, links; needs a terminal.

    Args:
        what: Name of a swarm that runs, by default the only one; or the folder of a run.

    """
    from sim.inspection.screen import live, recorded

    if what is not None and Path(what).is_dir():
        return recorded(Path(what))
    return live(*where.located(what), zenoh_config=where.zenoh_config)


_Count = Annotated[int | None, Parameter(validator=Number(gte=1))]
_Lines = Annotated[_Count, Parameter(help="End after this many lines; by default when interrupted.")]
_Topic = Annotated[str, Parameter(help="The topic, whole or without fanet/SWARM/; * stands for any part.")]


@topic.command(name="list")
def list_(
    *, seconds: Annotated[float, Parameter(validator=Number(gt=0, lte=3600))] = 2.0, where: SwarmFlags = SwarmFlags()
) -> int:
    """List the topics on which something is said, with kinds of messages and rates.

    Args:
        seconds: How long to listen.

    """
    from sim.inspection.topics import show_list

    return show_list(*where.located(), seconds=seconds, zenoh_config=where.zenoh_config)


@topic.command
def echo(name: _Topic, *, count: _Count = None, where: SwarmFlags = SwarmFlags()) -> int:
    """Print what is said on a topic, one JSON object a line; MAVLink is decoded.

    Args:
        count: End after this many messages; by default when interrupted.

    """
    from sim.inspection.topics import show_echo

    return show_echo(*where.located(), name=name, count=count, zenoh_config=where.zenoh_config)


@topic.command
def hz(name: _Topic, *, count: _Lines = None, where: SwarmFlags = SwarmFlags()) -> int:
    """Print once a second how often a topic is put on: mean, least and greatest interval, standard deviation."""
    from sim.inspection.topics import show_rate

    return show_rate(*where.located(), name=name, count=count, zenoh_config=where.zenoh_config, of_bytes=False)


@topic.command
def bw(name: _Topic, *, count: _Lines = None, where: SwarmFlags = SwarmFlags()) -> int:
    """Print once a second how many bytes a topic carries: mean, least and greatest put."""
    from sim.inspection.topics import show_rate

    return show_rate(*where.located(), name=name, count=count, zenoh_config=where.zenoh_config, of_bytes=True)
