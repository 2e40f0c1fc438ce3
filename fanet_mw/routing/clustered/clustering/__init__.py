"""How the leader divides nodes into clusters, behind one contract (`Clustering`); `clusters.method` names a method.

`bisection` makes balanced clusters; `succession` is the order in which members stand in for their head, the same for
every method.
"""

from fanet_mw.routing.clustered.clustering.bisection import Balanced, balanced
from fanet_mw.routing.clustered.clustering.contract import Cluster, Clustering, Promise, Swarm, succession

__all__ = ["Balanced", "Cluster", "Clustering", "Promise", "Swarm", "balanced", "succession"]
