"""What the steps that are left of a plan need of the present, and which of them needs it first."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from knowledge_base.language.effect import Add, NumericEffect
from knowledge_base.language.expression import TRUE, Atom, Constant, Expression
from knowledge_base.language.identity_cache import IdentityCache
from planning.domain import GroundStep, PlanningDomain
from planning.execution.regression import Leaf, UnregressableError, conjuncts, leaves, regressed
from planning.plan import PlanStep
from planning.problem.relevance import changed, names_of


class CausalNeeds:
    """The causal links of a plan's steps from the present, by regression.

    Args:
        steps: the plan's steps; they are spoken of by their number, from 1.
        domain: has their conditions and effects.
        goal: what they are for; it counts as the user after the last step.

    Raises:
        InputError: a step names no action of the domain.
    """

    def __init__(self, steps: Sequence[PlanStep], domain: PlanningDomain, goal: Expression) -> None:
        self._steps = [_Regressing.of(domain.ground(step)) for step in steps]
        self._names: dict[int, frozenset[str]] = {}  # by identity: all conditions live as long as what was found
        wanted = dict.fromkeys(conjuncts(goal), len(steps) + 1)
        self._found: dict[tuple[int, ...], _Found | None] = {(): _Found(wanted, tuple(filter(_is_open, wanted)))}

    def before(self, left: tuple[int, ...]) -> Mapping[Expression, int] | None:
        """Conditions that hold now exactly if the steps with these numbers, in this order, lead to the goal.

        Each with the number of the first step that needs it (the goal's is one more than the last step's).
        `None` if what is needed cannot be written as a condition, see `UnregressableError`.
        """
        known = next(cut for cut in range(len(left) + 1) if left[cut:] in self._found)
        for cut in range(known - 1, -1, -1):  # not by recursion: a plan may be long
            self._found[left[cut:]] = self._prepended(left[cut], self._found[left[cut + 1 :]])
        found = self._found[left]
        return None if found is None else MappingProxyType(found.needed)

    def _prepended(self, number: int, after: _Found | None) -> _Found | None:
        if after is None:
            return None
        step = self._steps[number - 1]
        own = dict.fromkeys(step.needed, number)
        brought, touched = self._touched(step, after)
        rest = dict(after.needed)
        for condition in brought:
            del rest[condition]
        users = [rest.pop(condition) for condition in touched]
        needed = {**own, **rest, **own}
        fresh: list[Expression] = []
        try:
            for condition, user in zip(touched, users, strict=True):
                for part in conjuncts(regressed(condition, step.changes)):
                    before = len(needed)
                    needed.setdefault(part, user)  # hashed once: it may be long
                    if len(needed) > before and _is_open(part):
                        fresh.append(part)
        except UnregressableError:
            return None
        gone = set(map(id, touched))
        kept = [one for one in after.open if id(one) not in gone]
        if step.open:
            kept = [*step.open, *(one for one in kept if one not in own)]
        return _Found(needed, (*kept, *fresh))

    def _touched(self, step: _Regressing, after: _Found) -> tuple[list[Expression], list[Expression]]:
        """Of what later steps need: what the step brings about in any case, and what else it may have to do with.

        That is little; the rest is taken over as it is.
        """
        plain, changed_here = step.plain, step.changed
        if plain is None:  # what it changes depends on the world: everything about the same predicates
            return [], [one for one in after.needed if not changed_here.isdisjoint(self._about(one))]
        touched = [one for one in after.open if not changed_here.isdisjoint(self._about(one))]
        if not after.needed.keys().isdisjoint(plain.deletes):
            hit = {*plain.deletes, *touched}
            touched = [one for one in after.needed if one in hit]  # in their order
        return [atom for atom in plain.adds if atom in after.needed], touched

    def _about(self, condition: Expression) -> frozenset[str]:
        """The predicates and functions that the condition asks about."""
        found = self._names.get(id(condition))
        if found is None:
            found = self._names[id(condition)] = frozenset(names_of(condition))
        return found


@dataclass(frozen=True, slots=True)
class _Found:
    """What is needed before some steps, with its first user; and which of it is no ground fact, in order."""

    needed: Mapping[Expression, int]
    open: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class _Regressing:
    """What has to be known of a step to see what is needed before it.

    Attributes:
        needed: its own conditions, as an ordered set.
        open: those of them that are no ground facts.
        changes: what it changes.
        changed: predicates and functions of that.
        plain: the ground facts among it, if there are no other changes.
    """

    needed: Mapping[Expression, None]
    open: tuple[Expression, ...]
    changes: tuple[Leaf, ...]
    changed: frozenset[str]
    plain: _Plain | None

    @staticmethod
    def of(step: GroundStep) -> _Regressing:
        """Made once: one plan has most steps of the one before."""
        known = _regressing.find(step, None)
        if known is None:
            needed, changes = dict.fromkeys(conjuncts(step.typed)), leaves(step.effect)
            open_ = tuple(filter(_is_open, needed))
            known = _Regressing(needed, open_, changes, changed(step.effect), _plain(changes))
            _regressing.keep(step, None, known)
        return known


_regressing: IdentityCache[GroundStep, _Regressing] = IdentityCache(size=1024)


@dataclass(frozen=True, slots=True)
class _Plain:
    """The ground facts that a step makes true and false, whatever the world is like."""

    adds: tuple[Expression, ...]
    deletes: tuple[Expression, ...]


def _plain(changes: Iterable[Leaf]) -> _Plain | None:
    """What is changed in any case, if there are no other changes."""
    adds: dict[Expression, None] = {}
    deletes: dict[Expression, None] = {}
    for one in changes:
        if one.variables or one.condition != TRUE or isinstance(one.change, NumericEffect) or _is_open(one.change.atom):
            return None
        (adds if isinstance(one.change, Add) else deletes)[one.change.atom] = None
    return _Plain(tuple(adds), tuple([atom for atom in deletes if atom not in adds]))  # an addition wins


def _is_open(e: Expression) -> bool:
    """Whether it is anything but a ground fact."""
    return not isinstance(e, Atom) or not all(isinstance(term, Constant) for term in e.args)
