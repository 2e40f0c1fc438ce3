"""Does any origin lose more than a hundredth of its packets, in swarms at rest that nobody tuned?

    python tests/fuzz/origins.py 200 --seed 1 --set routing.protocol=rounds

Drawn are grids of 9 to 45 UAVs in which every node hears others, and the phases of their packets, which stay the same
for the whole run: what collides once could collide each second. A line per origin below .99; the exit status is 1 if
there is one.
"""

import argparse
import random
import sys
from collections import Counter

from fanet_mw.trace import Delivered, Generated
from fanet_mw.units import S
from sim.run.virtual import simulate
from sim.scenarios import catalog

_DURATION_S, _DRAIN_S, _WARMUP_S = 32, 11, 6
_LEAST = 0.99


def shares(keys: list[str]) -> dict[int, float]:
    """The part of its packets x targets that each origin delivers, of those that had time."""
    scenario = catalog.find("clusters", keys)
    sent, got, names = Counter[int](), Counter[int](), set[tuple[int, int]]()
    for record in simulate(scenario).records:
        if isinstance(record, Generated) and record.app == "traffic" and record.t_ns < (_DURATION_S - _DRAIN_S) * S:
            sent[record.node] += scenario.node_count - 1
            names.add((record.node, record.seq))
        elif isinstance(record, Delivered) and (record.origin, record.seq) in names:
            got[record.origin] += 1
    return {node: got[node] / wanted for node, wanted in sent.items()}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("swarms", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--set", nargs="*", default=[], dest="keys", metavar="KEY=VALUE")
    options = parser.parse_args()
    below = origins = 0
    least = 1.0
    for number in range(options.swarms):
        numbers = random.Random(f"{options.seed}/{number}")
        count = numbers.randint(9, 45)
        keys = [
            f"nodes.count={count}", f"nodes.columns={numbers.randint(3, 9)}",
            f"nodes.spacing_m={numbers.choice([110, 170, 200, 230])}", f"seed={numbers.randint(1, 10**6)}",
            f"duration_s={_DURATION_S}", f"drain_s={_DRAIN_S}", f"warmup_s={_WARMUP_S}", "routing.lifetime_s=10",
            f"traffic.sources={count - 1}", f"clusters.count={max(1, count // 11)}",
            f"traffic.payload_bytes={numbers.choice([100, 300])}", *options.keys,
        ]  # fmt: skip
        for node, share in shares(keys).items():
            origins += 1
            least = min(least, share)
            if share < _LEAST:
                below += 1
                print(f"swarm {number}: origin {node} delivers {share:.4f}: {' '.join(keys)}", flush=True)
    print(f"{options.swarms} swarms, {origins} origins, {below} below {_LEAST}, the least {least:.4f}")
    return 1 if below else 0


if __name__ == "__main__":
    sys.exit(main())
