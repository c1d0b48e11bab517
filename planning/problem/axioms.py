"""Recursive derived predicates whose inputs actions change, compiled into actions that derive facts.

An expression cannot replace `(above ?a ?b)` if actions move blocks, and no engine of this project supports axioms. Each
axiom becomes a bookkeeping action that adds its head. Each action that may falsify a derived fact deletes all derived
facts, and bookkeeping actions derive them again (Gazen & Knoblock 1997; Thiébaux, Hoffmann & Nebel 2005).

A fact that is derived in this way is true in the original domain. A fact that is not yet derived may be true too, so no
condition may require that such a predicate is false.

Such plans are for display only, because a monitor observes facts and numbers, and no derived predicates.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.effect import Add, AllOf, Delete, Effect, ForEach, effect_conditions, effect_leaves
from knowledge_base.language.syntax.expression import Atom, Exists, Expression, Or, TypedVariable, Variable
from knowledge_base.language.syntax.rewriting import denied, names_of
from knowledge_base.pddl.problem_text import Metric
from knowledge_base.world.axioms import Axiom
from planning.model.actions import PlanningAction
from planning.model.cancellable_work import WorkLimit
from planning.model.domain import PlanningDomain
from planning.model.ground_action import GroundAction
from planning.model.problem import Problem, UnsupportedActionError, UnsupportedGoalError
from planning.problem.construction import build_problem
from planning.problem.derived import Derivation, derivation
from planning.problem.expressions import name_of
from planning.problem.relevance import relevant

_DERIVE = "derive "  # the blank distinguishes the name from every declared name


@dataclass(frozen=True, slots=True)
class Derivable:
    """A domain in which actions replace the axioms.

    Attributes:
        original: the derivation of the domain with derived predicates.
        domain: the domain without derived predicates, which engines and explanations use.
        predicates: the predicates that the bookkeeping actions derive.
    """

    original: Derivation
    domain: PlanningDomain
    predicates: frozenset[str]

    @staticmethod
    def of(domain: PlanningDomain) -> Derivable | None:
        """Return the compiled domain; `None` if superfluous, or if durative actions may falsify a derived fact."""
        original = derivation(domain)
        predicates = frozenset(original.unsupported)
        plain = original.domain
        axioms = [axiom for axiom in domain.axioms if axiom.predicate in predicates]
        bodies = [original.expand(axiom.condition) for axiom in axioms]
        harmed = _Harmed.of(bodies)
        ending = {name: action for name, action in plain.actions.items() if harmed.by(action.effect)}
        if not axioms or any(action.timed is not None for action in ending.values()):
            return None
        reset = AllOf(tuple(_forgotten(name, plain) for name in sorted(predicates)))
        actions = {
            name: replace(action, effect=AllOf((action.effect, reset))) if name in ending else action
            for name, action in plain.actions.items()
        }
        for axiom, body in zip(axioms, bodies, strict=True):
            for action in _deriving(axiom, body):
                known = sum(name.startswith(action.name + " ") for name in actions)
                name = f"{action.name} #{known + 1}"
                actions[name] = replace(action, name=name)
        return Derivable(original, replace(plain, actions=actions), predicates)

    def world(self, world: World) -> World:
        """Return the world with all derived facts."""
        return self.original.complete(world)

    def build_problem(
        self,
        world: World,
        goal: Expression,
        metric: Metric | None = None,
        *,
        durations: bool = False,
        patience: WorkLimit | None = None,
    ) -> Problem:
        """Return the problem, as `planning.problem.construction.build_problem`; its plans omit bookkeeping actions.

        Raises:
            UnsupportedGoalError, UnsupportedActionError: also if a condition requires that a derived predicate is
                false.
        """
        wanted = self.original.expand(goal)
        self._refuse_denied(wanted)
        return _kept_books(
            build_problem(self.domain, self.world(world), wanted, metric, durations=durations, patience=patience)
        )

    def without_axioms(self, world: World, goal: Expression) -> tuple[PlanningDomain, World, Expression]:
        """Return domain, world and goal without derived predicates, for an explanation of 'no plan'."""
        return self.domain, self.world(world), self.original.expand(goal)

    def _refuse_denied(self, goal: Expression) -> None:
        """Raise an error if a condition requires that a derived fact is false, which bookkeeping cannot prove."""
        for atom in self._unknowable(goal):
            raise UnsupportedGoalError(self._describe("the goal", atom), place=atom.place)
        for action in relevant(goal, None, self.domain.actions.values()).actions:
            owner = f"the planning action '{action.name}'"
            if action.name.startswith(_DERIVE):
                owner = f"the axiom at {action.place}"
            for atom in self._unknowable(action.precondition, *effect_conditions(action.effect)):
                raise UnsupportedActionError(self._describe(owner, atom), place=atom.place)

    def _unknowable(self, condition: Expression, *of_effects: Expression) -> Iterator[Atom]:
        asked = [denied(condition, wanted=True)]
        asked += [denied(one, wanted=wanted) for one in of_effects for wanted in (True, False)]
        return (atom for atoms in asked for atom in atoms if atom.predicate in self.predicates)

    def _describe(self, owner: str, atom: Atom) -> str:
        return f"{owner} asks for the opposite of {self.original.why(atom.predicate)}"


@dataclass(frozen=True, slots=True)
class _Harmed:
    """The predicates whose changes may falsify a derived fact, by the direction of the change."""

    when_false: frozenset[str]
    when_true: frozenset[str]

    @staticmethod
    def of(bodies: Collection[Expression]) -> _Harmed:
        asked = {name for body in bodies for name in names_of(body)}
        wanted = {atom.predicate for body in bodies for atom in denied(body, wanted=False)}
        unwanted = {atom.predicate for body in bodies for atom in denied(body, wanted=True)}
        return _Harmed(frozenset(wanted), frozenset((asked - wanted) | unwanted))

    def by(self, effect: Effect) -> bool:
        """Return whether the effect may falsify a derived fact; a numeric effect may do so in both directions."""
        return any(
            name_of(leaf) in (self.when_false if isinstance(leaf, Delete) else self.when_true)
            for leaf in effect_leaves(effect)
        )


def _forgotten(predicate: str, domain: PlanningDomain) -> Effect:
    parameters = domain.schema.predicates[predicate].parameters
    variables = tuple(replace(p, name=f"forgotten{i}") for i, p in enumerate(parameters))
    gone = Delete(Atom(predicate, tuple(Variable(p.name) for p in variables)))
    return ForEach(variables, gone) if variables else gone


def _deriving(axiom: Axiom, body: Expression) -> Iterator[PlanningAction]:
    """Yield an action for each alternative; variables of `exists` become parameters, so that joins bind them."""
    match body:
        case Or(parts):
            for part in parts:
                yield from _deriving(axiom, part)
        case Exists(variables, inner) if _names(variables).isdisjoint(_names(axiom.parameters)):
            for action in _deriving(axiom, inner):
                yield replace(action, parameters=(*action.parameters, *variables))
        case _:
            head = Atom(axiom.predicate, tuple(Variable(p.name) for p in axiom.parameters))
            yield PlanningAction(_DERIVE + axiom.predicate, axiom.parameters, body, Add(head), axiom.place)


def _names(parameters: Collection[TypedVariable]) -> set[str]:
    return {one.name for one in parameters}


def _kept_books(problem: Problem) -> Problem:
    """Return the problem with bookkeeping actions that have no step and no cost."""

    def whole() -> Problem:
        return _kept_books(problem.unsliced()) if problem.unsliced is not None else problem

    actions = tuple(map(_book, problem.actions))
    return replace(problem, actions=actions, unsliced=None if problem.unsliced is None else whole)


def _book(action: GroundAction) -> GroundAction:
    derives = action.step is not None and action.step.action.startswith(_DERIVE)
    return replace(action, step=None, cost=0.0) if derives else action
