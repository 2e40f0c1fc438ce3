"""What a run in real time has come to, for those who watch it."""

from typing import NamedTuple


class Progress(NamedTuple):
    """The state of a swarm that runs."""

    swarm_s: float
    duration_s: float
    time_scale: float
    """The pace of the swarm's clock: 1 is real time."""
    delivered: float | None
    """The share of the traffic's copies that arrived, of packets that are ten seconds old; None: there are none yet."""
    late: float
    """The share of frames that were announced too late."""
    confirmed: int
    survivors: int
    """Of the scenario; 0: nobody is searched for."""

    def figures(self) -> str:
        """All but the time, in words."""
        parts = [f"clock {self.time_scale:.3g}"]
        if self.delivered is not None:
            parts.append(f"delivered {self.delivered:.1%}")
        parts.append(f"late {self.late:.2%}")
        if self.survivors:
            parts.append(f"confirmed {self.confirmed} of {self.survivors}")
        return ", ".join(parts)

    def sentence(self) -> str:
        return f"{self.swarm_s:.0f} of {self.duration_s:g} s: {self.figures()}"
