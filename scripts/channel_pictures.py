"""Draws what docs/explanation/channel.md shows: loss over distance and height of each channel, and fading over time."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from emulator.channel import fading
from emulator.channel.path_loss import SPEED_OF_LIGHT_M_S
from emulator.channel.propagation import received_dbm
from emulator.kernel import state
from emulator.kernel.state import Reals
from fanet_mw.scenario import Radio, config

FOLDER: Final = Path(__file__).parents[1] / "docs" / "explanation"
CHANNELS: Final = ("log_distance", "friis", "two_ray", "air_to_air", "air_to_ground", "uma_av")
ANTENNA_M: Final = {"uma_av": 25.0}
"""The height of the other node; 2 m in the other channels."""


def radio(**keys: object) -> Radio:
    return config.build({"clusters": {"count": 1}, "radio": keys}).radio


def loss_db(channel: str, distance_m: Reals | float, height_m: Reals | float) -> Reals:
    """The loss between a node at `height_m` and one near the ground, `distance_m` apart along the ground."""
    keys = radio(channel=channel, environment="urban")
    along, up = np.broadcast_arrays(np.asarray(distance_m, float), np.asarray(height_m, float))
    here = np.column_stack([along, np.zeros_like(along), up])
    there = np.tile([0.0, 0.0, ANTENNA_M.get(channel, 2.0)], (len(along), 1))
    return keys.tx_power_dbm - received_dbm(np.linalg.norm(here - there, axis=1), here, there, keys)


def panels(title: str, draw: Callable[[Axes, str], None]) -> Figure:
    figure = Figure(figsize=(11, 6.4), layout="constrained")
    for axes, channel in zip(figure.subplots(2, 3, sharey=True).flat, CHANNELS, strict=True):
        draw(axes, channel)
        axes.set_title(f"{channel}, other node at {ANTENNA_M.get(channel, 2.0):g} m", fontsize=9)
        axes.grid(alpha=0.3)
        axes.set_ylabel("loss [dB]")
    figure.suptitle(title, fontsize=10)
    return figure


def over_distance(axes: Axes, channel: str) -> None:
    along = np.geomspace(10, 10_000, 300)
    for height_m in (2.0, 10.0, 30.0, 100.0):
        axes.semilogx(along, loss_db(channel, along, height_m), label=f"{height_m:g} m up")
    axes.legend(fontsize=7)
    axes.set_xlabel("distance along the ground [m]")


def over_height(axes: Axes, channel: str) -> None:
    up = np.linspace(1, 150, 600)
    for along_m in (50.0, 200.0, 1000.0):
        axes.plot(up, loss_db(channel, along_m, up), label=f"{along_m:g} m away")
    axes.legend(fontsize=7)
    axes.set_xlabel("height [m]")


def correlation() -> Figure:
    """The correlation of Rayleigh-faded power while one node moves, or both, beside J0^2 and J0^4."""
    keys = radio(channel="friis", fading="nakagami", nakagami_m=1)
    p, pf, g = np.zeros(state.PARAMETERS, np.int64), np.zeros(state.REALS), np.zeros(state.GLOBALS, np.int64)
    p[state.FADING], pf[state.FADING_SHAPE] = fading.law_of(keys)
    wavelength_m, table = SPEED_OF_LIGHT_M_S / (keys.frequency_mhz * 1e6), fading.tables(keys)
    way = np.linspace(0, 2, 81)  # wavelengths, at 1 m/s
    instants = np.rint(way * wavelength_m * 1e9).astype(int).tolist()
    angle = 2 * np.pi * (np.arange(400) + 0.5) / 400
    j0 = np.cos(np.multiply.outer(2 * np.pi * way, np.cos(angle))).mean(axis=1)
    figure = Figure(figsize=(7, 3.6), layout="constrained")
    axes = figure.subplots()
    random = np.random.Generator(np.random.PCG64(1))
    for both, color in ((False, "tab:blue"), (True, "tab:orange")):
        drawn = []
        for seed in range(40):
            at, velocity = random.uniform(0, 5000, (60, 3)), np.zeros((60, 3))
            velocity[::2, 0], velocity[1::2, 1] = 1.0, float(both)
            waves = fading.Waves(keys, seed=seed).of(at, velocity, 0)
            drawn += [[fading.gain(g, p, pf, waves, table, i, i + 1, t) - 1 for t in instants] for i in range(0, 60, 2)]
        gains = np.array(drawn)
        who = "both nodes move" if both else "one node moves"
        axes.plot(way, (gains * gains[:, :1]).mean(axis=0) / (gains[:, 0] ** 2).mean(), ".", color=color, label=who)
        axes.plot(way, j0 ** (4 if both else 2), color=color, lw=1, label="J0^4" if both else "J0^2 (Clarke, Jakes)")
    axes.set(xlabel="way of a node [wavelengths]", ylabel="correlation of the power")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    return figure


def main() -> None:
    pictures = {
        "distance": panels("Loss over distance, by the height of one node; 2412 MHz, urban", over_distance),
        "height": panels("Loss over the height of one node; 2412 MHz, urban", over_height),
        "fading": correlation(),
    }
    for name, figure in pictures.items():
        figure.savefig(FOLDER / f"channel-{name}.png", dpi=90)


if __name__ == "__main__":
    main()
