"""Is a set of clusters with given slots feasible, what bounds each traffic class, and what would make it so?

`plan` is the entry: a scenario and where the nodes are go in, a `Plan` comes out; `describe` puts it into lines.
"""

from fanet_mw.protocol.planner.demand import TrafficClass, demands
from fanet_mw.protocol.planner.design import Design
from fanet_mw.protocol.planner.feasibility import Change, ClassPlan, Plan, Site, evaluate
from fanet_mw.protocol.planner.head import ClusterPlan
from fanet_mw.protocol.planner.search import plan
from fanet_mw.protocol.planner.text import describe

__all__ = [
    "Change",
    "ClassPlan",
    "ClusterPlan",
    "Design",
    "Plan",
    "Site",
    "TrafficClass",
    "demands",
    "describe",
    "evaluate",
    "plan",
]
