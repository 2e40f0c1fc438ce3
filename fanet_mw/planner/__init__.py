"""Analysis before take-off: whether a scenario is feasible, which delays its traffic classes get, and what would help.

`plan` judges a scenario with given positions and returns a `ScenarioPlan`. `cheapest_change` finds a change that
makes a scenario feasible, `optimum` the configuration that meets a deadline with the least airtime. `describe` turns
results into text.
"""

from fanet_mw.planner.cheapest_change import ScenarioChange, cheapest_change
from fanet_mw.planner.demand import ClassPlan, TrafficClass, demands
from fanet_mw.planner.feasibility import evaluate
from fanet_mw.planner.flood_loss import Loss, loss
from fanet_mw.planner.head_slot import ClusterPlan
from fanet_mw.planner.lossy_plan import LossyPlan, plan_lossy
from fanet_mw.planner.not_counted import not_counted
from fanet_mw.planner.optimum import Optimum, optimum
from fanet_mw.planner.plan import plan, with_capacity
from fanet_mw.planner.plan_text import (
    describe,
    describe_change,
    describe_loss,
    describe_lossy,
    describe_not_counted,
    describe_optimum,
)
from fanet_mw.planner.scenario_plan import ScenarioPlan
from fanet_mw.planner.site import Site
from fanet_mw.planner.variant import Variant, vary

__all__ = [
    "ClassPlan",
    "ClusterPlan",
    "Loss",
    "LossyPlan",
    "Optimum",
    "ScenarioChange",
    "ScenarioPlan",
    "Site",
    "TrafficClass",
    "Variant",
    "cheapest_change",
    "demands",
    "describe",
    "describe_change",
    "describe_loss",
    "describe_lossy",
    "describe_not_counted",
    "describe_optimum",
    "evaluate",
    "loss",
    "not_counted",
    "optimum",
    "plan",
    "plan_lossy",
    "vary",
    "with_capacity",
]
