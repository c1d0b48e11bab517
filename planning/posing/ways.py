"""Ground actions in numbers (see `planning.posing.numbering`), and an index of what they need and add."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from planning.plan import PlanStep
from planning.quantities import Assignment

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Mapping, Sequence

_T = TypeVar("_T")
_MOST_KNOWN = 16


class Way(NamedTuple):
    """One way to take a step; a tuple, for thousands are made for each problem.

    Attributes:
        step: the step; `None` for bookkeeping.
        needs: literals and bounds that must hold before.
        adds: literals that hold afterwards and fluents that it changes.
        deletes: literals that hold no longer.
        assignments: how it changes them.
        cost: `None` if what it does to the metric is no cost.
        number: the same for what is left of a way when parts that do not matter are left out.
    """

    step: PlanStep | None
    needs: tuple[int, ...]
    adds: tuple[int, ...]
    deletes: tuple[int, ...]
    assignments: tuple[Assignment, ...] = ()
    cost: float | None = 1.0
    number: int = -1


Key = tuple[str, tuple[str, ...]] | None


def key(step: PlanStep | None) -> Key:
    """The step by value; hashed much faster than itself."""
    return None if step is None else (step.action, step.args)


class Ways:
    """Ways in order, indexed when that is first asked for; referred to by position."""

    def __init__(self, ways: Sequence[Way]) -> None:
        self.all = ways
        self._known: dict[Hashable, Any] = {}

    def known(self, key: Hashable, work_out: Callable[[], _T]) -> _T:
        """What follows from these ways and `key`; worked out unless that was done lately."""
        found: _T = self._known.pop(key) if key in self._known else work_out()
        self._known[key] = found  # the last one is kept longest
        if len(self._known) > _MOST_KNOWN:
            del self._known[next(iter(self._known))]
        return found

    @cached_property
    def counts(self) -> Sequence[int]:
        """How much each way needs."""
        return [len(way.needs) for way in self.all]

    @cached_property
    def users(self) -> Mapping[int, Sequence[int]]:
        """Literal or bound -> the ways that need it."""
        users: dict[int, list[int]] = {}
        for i, way in enumerate(self.all):
            for one in way.needs:
                users.setdefault(one, []).append(i)
        return users

    @cached_property
    def adders(self) -> Mapping[int, Sequence[int]]:
        """Literal or fluent -> the ways that add or change it; none that need it, since they bring nothing."""
        adders: dict[int, list[int]] = {}
        for i, way in enumerate(self.all):
            for one in way.adds:
                if one not in way.needs:
                    adders.setdefault(one, []).append(i)
        return adders

    @cached_property
    def touching(self) -> Mapping[int, Sequence[int]]:
        """Literal, bound or fluent -> the ways that have anything to do with it."""
        touching: dict[int, list[int]] = {}
        for i, way in enumerate(self.all):
            for one in {*way.needs, *way.adds, *way.deletes}:
                touching.setdefault(one, []).append(i)
        return touching

    @cached_property
    def naming(self) -> Mapping[str, Sequence[int]]:
        """Object -> the ways whose steps name it."""
        naming: dict[str, list[int]] = {}
        for i, way in enumerate(self.all):
            for name in set(way.step.args) if way.step else ():
                naming.setdefault(name, []).append(i)
        return naming

    @cached_property
    def of_step(self) -> Mapping[Key, Sequence[int]]:
        """Step, see `key` -> the ways to take it."""
        of_step: dict[Key, list[int]] = {}
        for i, way in enumerate(self.all):
            of_step.setdefault(key(way.step), []).append(i)
        return of_step
