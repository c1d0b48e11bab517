"""What the steps that are left of a plan need of the present, and which of them needs it first."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from knowledge_base.language.effect import Assign
from knowledge_base.language.expression import Atom, Constant, Expression
from planning.domain import PlanningDomain
from planning.execution.regression import Leaf, UnregressableError, conjuncts, leaves, regressed
from planning.plan import PlanStep
from planning.posing.relevance import changed, names_of


class Needs:
    """The causal links of a plan's steps from the present, by regression.

    Args:
        steps: the plan's steps; they are spoken of by their number, from 1.
        domain: has their conditions and effects.
        goal: what they are for; it counts as the user after the last step.

    Raises:
        InputError: a step names no action of the domain.
    """

    def __init__(self, steps: Sequence[PlanStep], domain: PlanningDomain, goal: Expression) -> None:
        self._goal = len(steps) + 1
        ground = [domain.ground(step) for step in steps]
        self._preconditions = [conjuncts(one.typed) for one in ground]
        self._changes = [leaves(one.effect) for one in ground]
        self._changed = [changed(one.effect) for one in ground]
        self._plain = [_plain(changes) for changes in self._changes]
        self._names: dict[int, frozenset[str]] = {}  # by identity: all conditions live as long as what was found
        self._found: dict[tuple[int, ...], dict[Expression, int] | None] = {
            (): dict.fromkeys(conjuncts(goal), self._goal)
        }

    def before(self, left: tuple[int, ...]) -> Mapping[Expression, int] | None:
        """Conditions that hold now exactly if the steps with these numbers, in this order, lead to the goal.

        Each with the number of the first step that needs it (the goal's is one more than the last step's).
        `None` if what is needed cannot be written as a condition, see `UnregressableError`.
        """
        for cut in range(len(left) - 1, -1, -1):  # not by recursion: a plan may be long
            if left[cut:] not in self._found:
                self._found[left[cut:]] = self._prepended(left[cut], self._found[left[cut + 1 :]])
        found = self._found[left]
        return None if found is None else MappingProxyType(found)

    def _prepended(self, step: int, after: dict[Expression, int] | None) -> dict[Expression, int] | None:
        if after is None:
            return None
        own, changes = dict.fromkeys(self._preconditions[step - 1], step), self._changes[step - 1]
        # Of what later steps need, a step has to do with little: the rest is taken over as it is.
        names, changed_here = self._names, self._changed[step - 1]
        about = [one for one in after if not changed_here.isdisjoint(names.get(id(one)) or self._asked(one))]
        touched = [one for one in about if self._touches(step, one)]
        rest = dict(after)
        for condition in touched:
            del rest[condition]
        needed = {**own, **rest, **own}
        try:
            for condition in touched:
                for part in conjuncts(regressed(condition, changes)):
                    needed.setdefault(part, after[condition])
        except UnregressableError:
            return None
        return needed

    def _touches(self, step: int, condition: Expression) -> bool:
        """Whether the step may have to do with a condition about what it changes; `False` is certain."""
        plain = self._plain[step - 1]
        return plain is None or not isinstance(condition, Atom) or not _is_ground(condition) or condition in plain

    def _asked(self, condition: Expression) -> frozenset[str]:
        """The predicates and functions that the condition asks about."""
        found = self._names[id(condition)] = frozenset(names_of(condition))
        return found


def _plain(changes: Iterable[Leaf]) -> frozenset[Atom] | None:
    """The ground facts that are changed in any case, if there are no other changes."""
    atoms = [None if one.variables or isinstance(one.change, Assign) else one.change.atom for one in changes]
    plain = frozenset(atom for atom in atoms if atom is not None and _is_ground(atom))
    return plain if len(plain) == len(atoms) else None


def _is_ground(atom: Atom) -> bool:
    return all(isinstance(term, Constant) for term in atom.args)
