"""Effects as frozen values: how an action changes the world (PDDL 2.1 effects with `forall` and `when`)."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_base.language.expression import Atom, Call, Expression, Located, Term, TypedVariable


@dataclass(frozen=True, slots=True)
class Add(Located):
    """The atom holds afterwards."""

    atom: Atom


@dataclass(frozen=True, slots=True)
class Delete(Located):
    """The atom holds no longer: `(not (on ?i ?s))`."""

    atom: Atom


@dataclass(frozen=True, slots=True)
class AllOf(Located):
    """All parts at once; `(and)` changes nothing."""

    parts: tuple[Effect, ...]


@dataclass(frozen=True, slots=True)
class ForEach(Located):
    """The effect for every choice of known objects: `(forall (?i - item) ...)`."""

    variables: tuple[TypedVariable, ...]
    effect: Effect


@dataclass(frozen=True, slots=True)
class When(Located):
    """The effect if the condition held before."""

    condition: Expression
    effect: Effect


@dataclass(frozen=True, slots=True)
class Assign(Located):
    """A numeric fluent changes: `(increase (failures ?i) 1)`; `operator` is one of `ASSIGNMENTS`."""

    operator: str
    call: Call
    value: Term


Effect = Add | Delete | AllOf | ForEach | When | Assign

NO_EFFECT = AllOf(())
"""`(and)`, the effect that changes nothing."""

ASSIGNMENTS = ("assign", "increase", "decrease", "scale-up", "scale-down")
EFFECT_KEYWORDS = ("and", "not", "forall", "when", *ASSIGNMENTS)
"""The words that open an effect and are not predicates."""
