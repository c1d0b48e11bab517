"""Transforms: agreement with scipy on random trees, and the cost of updates and look-ups; see docs/knowledge.md.

`python benchmarks/transforms.py [--trees N] [--json]`: random trees are compared with products of matrices by scipy.
The chain map -> base -> camera -> cup is then updated and looked up. A ratio compares with scipy's bare composition of
the same chain, without tree, time and interpolation. The share of a core is for 1,000 updates a second in all.
"""

import argparse
import json
import random
from collections.abc import Callable
from functools import reduce
from itertools import pairwise
from statistics import median
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp
from timing import Job, Pace, measure

from knowledge_base import Delta, KnowledgeBase, Schema, Transform, TransformTree, computed

CHAIN = ("map", "base", "camera", "cup")
RATE = 1000
"""Updates a second in all."""


@computed("(near ?a ?b - object)", reads=["(pose ?a ?b)"])
def near(pose: tuple[float, ...]) -> bool:
    return bool(pose) and sum(x * x for x in pose[:3]) < 1


SCHEMA = Schema.parse("""(define (domain d) (:constants map base camera cup - object)
  (:functions (pose ?frame ?reference - object) - geometry))""").with_computed(near)


def drawn(chance: random.Random) -> Transform:
    """Return a random transform, with a uniform orientation."""
    quaternion = np.array([chance.gauss(0, 1) for _ in range(4)])
    quaternion /= np.linalg.norm(quaternion)
    x, y, z = (chance.uniform(-10, 10) for _ in range(3))
    return Transform((x, y, z), tuple(quaternion.tolist()))


def matrix(one: Transform, other: Transform, fraction: float) -> Any:
    """Return the homogeneous matrix between two readings, by scipy's own interpolation."""
    found = np.eye(4)
    found[:3, :3] = Slerp([0, 1], Rotation.from_quat([one.rotation, other.rotation]))(fraction).as_matrix()
    found[:3, 3] = (1 - fraction) * np.array(one.translation) + fraction * np.array(other.translation)
    return found


def error_of(chance: random.Random) -> float:
    """Return the largest difference of a look-up in a random tree from the product of matrices."""
    tree, in_root, time = TransformTree(), {"0": np.eye(4)}, chance.uniform(0, 1)
    for number in range(1, chance.randint(2, 10)):
        parent, readings = str(chance.randrange(number)), (drawn(chance), drawn(chance))
        for at, reading in enumerate(readings):
            tree.update(parent, str(number), reading, at)
        in_root[str(number)] = in_root[parent] @ matrix(*readings, time)
    frame, reference = chance.choices(list(in_root), k=2)
    found = tree.look_up(frame, reference, time)
    expected = np.linalg.inv(in_root[reference]) @ in_root[frame]
    return float(np.abs(matrix(found, found, 0) - expected).max())


def compose(one: tuple[Rotation, Any], other: tuple[Rotation, Any]) -> tuple[Rotation, Any]:
    return one[0] * other[0], one[1] + one[0].apply(other[1])


def bare(readings: list[Transform]) -> Callable[[int], None]:
    """Return scipy's composition of a chain, as a job."""

    def run(times: int) -> None:
        for _ in range(times):
            reduce(compose, [(Rotation.from_quat(one.rotation), np.array(one.translation)) for one in readings])

    return run


class Publisher:
    """Updates of all arcs of the chain in turn, each 1 ms after the one before."""

    def __init__(self, tree: TransformTree) -> None:
        self.tree = tree
        self.arcs = list(pairwise(CHAIN))
        self.number = 0
        chance = random.Random(1)  # noqa: S311  a seed
        self.readings = [drawn(chance) for _ in range(100)]
        self.run(len(self.arcs))

    def run(self, times: int) -> None:
        for _ in range(times):
            self.number += 1
            parent, child = self.arcs[self.number % len(self.arcs)]
            self.tree.update(parent, child, self.readings[self.number % 100], self.number / RATE)


def bound(*conditions: str) -> Publisher:
    """Return the updates of a tree that a knowledge base with these installed conditions asks."""
    knowledge, tree = KnowledgeBase(SCHEMA), TransformTree()
    knowledge.apply(Delta(), "benchmark")
    knowledge.bind_transforms("pose", tree)
    publisher = Publisher(tree)
    for condition in conditions:
        knowledge.install(condition)
    return publisher


def jobs() -> dict[str, Job]:
    """Return the jobs: scipy alone, updates, look-ups, and updates with readers."""
    publisher = Publisher(TransformTree())
    publisher.run(100)
    tree = publisher.tree

    def look_up(time: float | None) -> Callable[[int], None]:
        def run(times: int) -> None:
            for _ in range(times):
                tree.look_up("cup", "map", time)

        return run

    static = TransformTree()
    for (parent, child), reading in zip(pairwise(CHAIN), publisher.readings, strict=False):
        static.fix(parent, child, reading)

    def look_up_static(times: int) -> None:
        for _ in range(times):
            static.look_up("cup", "map")

    return {
        "scipy": Job(bare(publisher.readings[:3])),
        "update": Job(Publisher(TransformTree()).run),
        "look-up of static arcs": Job(look_up_static),
        "look-up with interpolation": Job(look_up(0.05)),
        "update, bound, without readers": Job(bound().run),
        "update, bound, a condition on the chain": Job(bound("(near cup map)").run),
        "update, bound, ten conditions": Job(
            bound(*(f"(and (near cup map) (near base camera) (not (= {n} 0)))" for n in range(10))).run
        ),
    }


def main() -> None:
    """Print the largest error, the ratios and the shares of a core."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--trees", type=int, default=10_000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--seconds", type=float, default=0.2)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    chance = random.Random(0)  # noqa: S311  a seed
    error = max(error_of(chance) for _ in range(options.trees))
    figures = {name: median(found) for name, found in measure(jobs(), Pace(options.rounds, options.seconds)).items()}
    rows = {name: {"ratio": one / figures["scipy"], "share": one * RATE} for name, one in figures.items()}
    if options.json:
        print(json.dumps({"trees": options.trees, "largest error": error, "rows": rows}))
        return
    print(f"{options.trees:,} random trees: the largest difference of a matrix entry is {error:.1e}")
    print(f"{'':<42}{'ratio to scipy':>16}{'share of a core at 1,000/s':>30}")
    for name, row in rows.items():
        print(f"{name:<42}{row['ratio']:>16.2f}{row['share']:>30.1%}")


if __name__ == "__main__":
    main()
