"""When faults stop the program of a node: labels end faults as they do on the air, and several may stop it at once."""

import math
from collections.abc import Iterable

from fanet_mw.bus.radio_control import Control, Mishap, MishapKind


def stops_of(planned: Iterable[tuple[int, Control]], node: int) -> list[tuple[int, int | None]]:
    """When the program ends [ns], and when it is started again; None if it is not. `planned`: in any order of time."""
    standing: dict[str, tuple[int, float]] = {}
    spans: list[tuple[int, float]] = []
    for at_ns, control in sorted(planned, key=lambda one: one[0]):
        for label in [control.label] if control.label else [*standing]:
            if label in standing:
                begins_ns, ends_ns = standing.pop(label)
                spans.append((begins_ns, min(ends_ns, at_ns)))
        if isinstance(control, Mishap) and control.what is MishapKind.STOP and control.node == node:
            standing[control.label] = at_ns, at_ns + control.for_ns if control.for_ns else math.inf
    together: list[tuple[int, float]] = []
    for begins_ns, ends_ns in sorted([*spans, *standing.values()]):
        if together and begins_ns <= together[-1][1]:
            begins_ns, before_ns = together.pop()
            ends_ns = max(before_ns, ends_ns)
        together.append((begins_ns, ends_ns))
    return [(begins_ns, None if ends_ns == math.inf else int(ends_ns)) for begins_ns, ends_ns in together]
