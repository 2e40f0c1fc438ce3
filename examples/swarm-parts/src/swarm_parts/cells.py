"""Clusters by the cells of a square grid over the swarm; the node nearest a cell's middle leads it."""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, Field

from fanet_mw.routing.clustered.clustering import Cluster, Promise, Swarm
from fanet_mw.units import Enu, NodeId


class Options(BaseModel, extra="forbid"):
    """The table `[clusters.options]`."""

    cell_m: float = Field(0, ge=0, le=1e6)
    """Side of a cell; 0: half of the radio's range, so that everyone hears its head."""


class Cells:
    """A clustering method."""

    Options = Options

    def __init__(self, *, count: int, range_m: float, options: Mapping[str, Any]) -> None:
        self._cell_m = Options.model_validate(dict(options)).cell_m or range_m / 2

    @property
    def promise(self) -> Promise:
        return Promise(dominating=False)

    def divide(self, swarm: Swarm) -> list[Cluster]:
        cells: dict[tuple[int, int], list[NodeId]] = {}
        for node in sorted(swarm.positions):
            place = swarm.positions[node]
            cells.setdefault((int(place.east // self._cell_m), int(place.north // self._cell_m)), []).append(node)
        return [Cluster(self._head(cell, nodes, swarm), tuple(nodes)) for cell, nodes in sorted(cells.items())]

    def _head(self, cell: tuple[int, int], nodes: list[NodeId], swarm: Swarm) -> NodeId:
        middle = Enu((cell[0] + 0.5) * self._cell_m, (cell[1] + 0.5) * self._cell_m, 0.0)

        def apart(node: NodeId) -> tuple[float, NodeId]:
            place = swarm.positions[node]
            return Enu(place.east - middle.east, place.north - middle.north, 0.0).norm(), node

        return min(nodes, key=apart)
