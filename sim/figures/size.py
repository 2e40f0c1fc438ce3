"""Beyond the paper: swarms of 45 to 1,000 nodes."""

from typing import Final

from sim.figures.curves import P95, Panel, curves
from sim.figures.finished_runs import Row, Runs
from sim.figures.paper_claims import NEARLY_ALL, Claim, share_above
from sim.figures.recipe import Recipe


def _frames_per_packet(row: Row) -> float | None:
    """Frames on the air for each packet that was sent."""
    return row["frames.sent"] / row["generated"] if row["generated"] else None


def claims(runs: Runs) -> list[Claim]:
    largest = runs.levels("nodes.count")[-1]
    delivered = runs.per_seed("pdr", case="counter", nodes__count=largest)
    arrives = share_above(f"{largest} nodes: PDR of counter-based flooding", delivered, NEARLY_ALL)
    return [Claim(0, "Counter-based flooding delivers in the largest swarm.", [arrives])]


FIGURE: Final = Recipe(
    "size",
    "45 to 1,000 nodes",
    "size",
    "Grids of the paper's density, ten sources of 256 B a second to everyone. Frames: all of the run, hellos too.",
    curves(
        "nodes.count",
        "nodes",
        [
            Panel("pdr", "packet delivery ratio (from 0.9)", share=True, least=0.9),
            P95,
            Panel(_frames_per_packet, "frames on the air per packet", log=True),
        ],
    ),
    claims,
)
