#!/usr/bin/env python
"""Draw how the vehicles fly into docs/results/flight/: `python scripts/flights.py` (needs matplotlib)."""

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from sim.figures.colors import BLUE, GRAY, GREEN, RED  # noqa: E402  (the tree's root is on the path now)
from sim.figures.style import applied, canvas  # noqa: E402
from sim.world.engines.kinematic import Kinematic  # noqa: E402
from sim.world.engines.rotors.power import trimmed_w  # noqa: E402
from sim.world.engines.rotors.rigid_body import Rotors  # noqa: E402
from tests.tables.flight import STEP_S, TRIALS, Trial, around, in_gusts, stepped  # noqa: E402

NOMINAL_V = 3.7
"""Of a cell."""
OUT = ROOT / "docs" / "results" / "flight"


def _step(axes: Axes, trial: Trial) -> None:
    for axis, size, name, color in ((0, trial.step_m_s, "ahead", BLUE), (2, 2.0, "up", RED)):
        speed = stepped(trial, Rotors(trial.vehicle), axis, size)
        t_s = STEP_S * (1 + np.arange(len(speed)))
        axes.plot(t_s, speed, color=color, label=name)
        axes.axhline(size, color=color, linestyle=":", linewidth=0.8)
        if axis == 0:
            fast = stepped(trial, Kinematic(), axis, size)
            axes.plot(t_s, fast, color=GREEN, linestyle="--", label="ahead, fast model")
    axes.set(title="Step of the wanted velocity", xlabel="time [s]", ylabel="velocity [m/s]")
    axes.legend(loc="lower right")


def _gusts(axes: Axes, trial: Trial) -> None:
    off = in_gusts(trial)[:, 0]
    t_s = STEP_S * np.arange(len(off))
    looks = (("along the wind", BLUE, "-"), ("across", RED, "--"), ("up", GREEN, "-."))
    for axis, (name, color, dash) in enumerate(looks):
        axes.plot(t_s, off[:, axis], color=color, linestyle=dash, label=name, linewidth=0.9)
    title = f"Hover in wind of {trial.mean_wind_m_s:g} m/s, gusts of W20 = {trial.w20_m_s:g} m/s"
    axes.set(title=title, xlabel="time [s]", ylabel="off its place [m]")
    axes.legend(loc="upper center", ncols=3)
    axes.margins(y=0.2)


def _eight(axes: Axes, trial: Trial) -> None:
    full, wanted = around(trial, Rotors(trial.vehicle))
    fast, _ = around(trial, Kinematic())
    axes.plot(wanted[:, 0], wanted[:, 1], color="#cccccc", linewidth=4, label="wanted")
    axes.plot(full[:, 0], full[:, 1], color=BLUE, label="rotors")
    axes.plot(fast[:, 0], fast[:, 1], color=GREEN, linestyle="--", label="fast model")
    axes.set(title=f"Figure of eight in {trial.round_s:g} s", xlabel="east [m]", ylabel="north [m]", aspect="equal")
    axes.legend(loc="upper center", ncols=3)
    axes.margins(y=0.25)


def _power(axes: Axes, trial: Trial) -> None:
    speed = np.linspace(0.0, 16.0, 81)
    power = trimmed_w(trial.vehicle, speed, np.zeros_like(speed))
    (line,) = axes.plot(speed, power, color=BLUE, label="power")
    axes.set(title="Power and energy in steady flight", xlabel="airspeed [m/s]", ylabel="power [W]")
    least, most = (_hover_w(trial, minutes) for minutes in reversed(trial.published_range_min))
    middle, half = (least + most) / 2, (most - least) / 2
    bar = axes.errorbar(0.0, middle, yerr=half, fmt="o", color=BLUE, capsize=4, label="hover, published")
    axes.set_ylim(0, 1.35 * max(float(power.max()), most))
    beside = axes.twinx()
    beside.grid(visible=False)
    beside.spines["right"].set_visible(True)
    (other,) = beside.plot(speed[15:], power[15:] / speed[15:], color=RED, linestyle="--", label="energy per km")
    handles = [line, bar, other]
    if trial.published_kj_km is not None:
        published = beside.axhline(trial.published_kj_km, color=GRAY, linestyle=":")
        published.set_label("measured, by mass")
        handles.append(published)
    beside.set(ylabel="energy [kJ/km]", ylim=(0, 1.35 * float(power[15] / speed[15])))
    beside.legend(handles=handles, loc="upper center", ncols=2, fontsize="small", framealpha=1.0)


def _hover_w(trial: Trial, minutes: float) -> float:
    """The mean power that empties the battery in so many minutes."""
    battery = trial.vehicle.battery
    return NOMINAL_V * battery.cells * battery.capacity_ah * 60 / minutes


def main() -> None:
    """One picture per vehicle."""
    OUT.mkdir(parents=True, exist_ok=True)
    for trial in TRIALS:
        with applied():
            figure, panels = canvas(2, 2, width=5.5, height=3.75)
            for draw, axes in zip((_step, _gusts, _eight, _power), panels, strict=True):
                draw(axes, trial)
            figure.suptitle(f"{trial.vehicle.name}, {trial.vehicle.mass_kg:g} kg")
            figure.savefig(OUT / f"{trial.vehicle.name}.png", dpi=100, metadata={"Software": None})


if __name__ == "__main__":
    main()
