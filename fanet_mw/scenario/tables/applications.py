"""The entries of a scenario's `[[applications]]`: applications of other packages that UAVs carry."""

from typing import Annotated, Any, Literal

from pydantic import Field

from fanet_mw.extensions import OptionsOf, PartName
from fanet_mw.scenario.tables.sections import Id, Section


class ForeignApplication(Section):
    """An application of another package (documentation, how-to/extend), on board some or all UAVs."""

    use: Annotated[str, PartName("applications.use", ())]
    """The application: an entry point, or module and class."""
    nodes: Literal["all"] | tuple[Id, ...] = "all"
    """Ids of the nodes that carry it, or `all`."""
    options: Annotated[dict[str, Any], OptionsOf("applications.use", ())] = Field(default_factory=dict)
    """The application's own table, as its package documents it."""

    def on(self, node: int) -> bool:
        """True if a node carries it."""
        return self.nodes == "all" or node in self.nodes
