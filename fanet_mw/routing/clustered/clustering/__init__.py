"""Methods that divide nodes into clusters, all behind one contract (`Clustering`); `clusters.method` names one.

`bisection` needs positions only. `head_election` ranks nodes (lowest-ID, highest degree, WCA, lasting degree) and keeps
heads that are good enough. In `affinity`, neighbors vote for each other. `maintenance` adapts present clusters step by
step. `division` is what a leader uses: it asks one of these for clusters when they are due. `succession` is the order
in which the members of a cluster stand in for their head, `link_lifetime` how long a link between two nodes will last.
"""

from fanet_mw.routing.clustered.clustering.affinity import AffinityPropagation
from fanet_mw.routing.clustered.clustering.bisection import Balanced, balanced
from fanet_mw.routing.clustered.clustering.contract import Cluster, Clustering, Promise, Swarm, heads_of
from fanet_mw.routing.clustered.clustering.head_election import (
    HIGHEST_DEGREE,
    LOWEST_ID,
    Elected,
    LastingDegree,
    Weights,
    by_degree,
    by_id,
)
from fanet_mw.routing.clustered.clustering.link_lifetime import link_lifetime_s
from fanet_mw.routing.clustered.clustering.maintenance import Maintenance
from fanet_mw.routing.clustered.clustering.succession import succession

__all__ = [
    "HIGHEST_DEGREE",
    "LOWEST_ID",
    "AffinityPropagation",
    "Balanced",
    "Cluster",
    "Clustering",
    "Elected",
    "LastingDegree",
    "Maintenance",
    "Promise",
    "Swarm",
    "Weights",
    "balanced",
    "by_degree",
    "by_id",
    "heads_of",
    "link_lifetime_s",
    "succession",
]
