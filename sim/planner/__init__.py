"""Analysis before take-off: whether a scenario is feasible, which delays its traffic gets, and what would help."""

from sim.planner.cheapest_change import ScenarioChange, cheapest_change
from sim.planner.demand import ClassPlan, TrafficClass, demands
from sim.planner.feasibility import evaluate
from sim.planner.flood_loss import Loss, loss
from sim.planner.head_slot import ClusterPlan
from sim.planner.lossy_plan import LossyPlan, plan_lossy
from sim.planner.not_counted import not_counted
from sim.planner.plan import plan, with_capacity
from sim.planner.plan_text import (
    describe,
    describe_change,
    describe_loss,
    describe_lossy,
    describe_not_counted,
)
from sim.planner.scenario_plan import ScenarioPlan
from sim.planner.site import Site
from sim.planner.variant import Variant, vary

__all__ = [
    "ClassPlan",
    "ClusterPlan",
    "Loss",
    "LossyPlan",
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
    "evaluate",
    "loss",
    "not_counted",
    "plan",
    "plan_lossy",
    "vary",
    "with_capacity",
]
