"""Is a set of clusters with given slots feasible, what bounds each traffic class, and what would make it so?

`plan` is the entry: a scenario and where the nodes are go in, a `Plan` comes out; `cheapest_change` says what would
make it feasible, `optimum` what would meet a deadline with the least airtime; `describe` puts them into lines.
"""

from fanet_mw.planner.demand import ClassPlan, TrafficClass, demands
from fanet_mw.planner.feasibility import Plan, Site, evaluate
from fanet_mw.planner.head import ClusterPlan
from fanet_mw.planner.loss import Loss, loss
from fanet_mw.planner.optimum import Optimum, optimum
from fanet_mw.planner.search import Change, cheapest_change, plan, with_capacity
from fanet_mw.planner.text import describe, describe_change, describe_loss, describe_optimum
from fanet_mw.planner.variant import Variant, vary

__all__ = [
    "Change",
    "ClassPlan",
    "ClusterPlan",
    "Loss",
    "Optimum",
    "Plan",
    "Site",
    "TrafficClass",
    "Variant",
    "cheapest_change",
    "demands",
    "describe",
    "describe_change",
    "describe_loss",
    "describe_optimum",
    "evaluate",
    "loss",
    "optimum",
    "plan",
    "vary",
    "with_capacity",
]
