"""The floor: a minimal hand-written index of facts, with sets of arguments by predicate and by each argument."""

from collections.abc import Iterable

from knowledge.arcs import Arc
from knowledge.contender import Answers, Contender

Args = tuple[str, ...]


class Index:
    """Facts of any predicate; empty sets are removed."""

    def __init__(self) -> None:
        self.facts: dict[str, set[Args]] = {}
        self.by_argument: dict[tuple[str, int, str], set[Args]] = {}

    def add(self, predicate: str, args: Args) -> None:
        self.facts.setdefault(predicate, set()).add(args)
        for position, value in enumerate(args):
            self.by_argument.setdefault((predicate, position, value), set()).add(args)

    def discard(self, predicate: str, args: Args) -> None:
        self.facts[predicate].discard(args)
        for position, value in enumerate(args):
            key = (predicate, position, value)
            self.by_argument[key].discard(args)
            if not self.by_argument[key]:
                del self.by_argument[key]


class Floor(Contender):
    """Comprehensions over the index, without checks, history, notifications or locks."""

    name = "floor"

    def __init__(self) -> None:
        self.index = Index()

    def insert(self, things: Iterable[str], arcs: Iterable[Arc]) -> None:  # noqa: ARG002  it has no objects
        for kind, one, other in arcs:
            self.index.add(kind, (one, other))

    def point(self, item: str, place: str) -> bool:
        return (item, place) in self.index.facts["on"]

    def pattern(self, place: str) -> Answers:
        return [{"x": x} for x, _ in self.index.by_argument["on", 1, place]]

    def rare(self, hall: str) -> Answers:
        return [{"x": x} for x, _ in self.index.by_argument["opens", 1, hall]]

    def inside(self, hall: str, item: str) -> Answers:
        held = self.index.facts["in"]
        return [{"x": x} for x, _ in self.index.by_argument.get(("near", 1, item), ()) if (x, hall) in held]

    def join(self, place: str) -> Answers:
        found = self.index.by_argument
        return [{"x": x, "y": y} for x, _ in found["on", 1, place] for _, y in found["near", 0, x]]

    def move(self, item: str, old: str, new: str) -> None:
        self.index.discard("on", (item, old))
        self.index.add("on", (item, new))


CONTENDER = Floor
