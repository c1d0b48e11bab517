"""PDDL constructs that this project does not plan with: refused by name, with engines that support them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from knowledge_base.errors import Place, UnsupportedConstructError
from knowledge_base.language.syntax.sexpr import Group, Node, Word

_HYBRID = "hybrid planners (PDDL+), such as ENHSP or OPTIC"
_TEMPORAL = "temporal planners, such as OPTIC or Tamer"
_HIERARCHICAL = "hierarchical planners (HDDL), such as Aries or PANDA"
_CONTINGENT = "contingent planners, such as CPOR"
_WHOLE_PLANS = "planners for PDDL 3, such as OPTIC or SGPlan"
_CHANCE = "probabilistic planners (PPDDL), such as FF-Replan"
_OBJECTS = "planners with object fluents, such as Tamer"


@dataclass(frozen=True, slots=True)
class _Construct:
    """Its meaning in a few words, and the engines that support it."""

    meaning: str
    engines: str


SECTIONS: Mapping[str, _Construct] = {
    ":process": _Construct("numbers that change by themselves while time passes", _HYBRID),
    ":event": _Construct("changes that happen by themselves", _HYBRID),
    ":task": _Construct("tasks that methods break down", _HIERARCHICAL),
    ":method": _Construct("ways to break a task down", _HIERARCHICAL),
    ":htn": _Construct("tasks to be broken down by methods", _HIERARCHICAL),
    ":constraints": _Construct("conditions on whole plans", _WHOLE_PLANS),
}
"""Sections of domains and problems."""

ACTION_PARTS: Mapping[str, _Construct] = {
    ":observe": _Construct("what is found out only while the plan is carried out", _CONTINGENT),
}

_TRAJECTORIES = (
    *("always", "sometime", "within", "at-most-once"),
    *("sometime-after", "sometime-before", "hold-during", "hold-after"),
)
_FORMS: Mapping[str, _Construct] = {
    "preference": _Construct("conditions that may be given up", _WHOLE_PLANS),
    "oneof": _Construct("a world that is not known at first", _CONTINGENT),
    "unknown": _Construct("a world that is not known at first", _CONTINGENT),
    "probabilistic": _Construct("effects that happen by chance", _CHANCE),
    **dict.fromkeys(_TRAJECTORIES, _Construct("conditions on whole plans", _WHOLE_PLANS)),
}
_CONTINUOUS = _Construct("numbers that change while the action goes on", _HYBRID)
TIMED_INITIAL = _Construct("facts that change by themselves at a given time", _TEMPORAL)
OBJECT_FLUENTS = _Construct("functions whose values are things", _OBJECTS)
DURATION_AT_END = _Construct("a duration that is settled only at the end", _TEMPORAL)
ACROSS_TIMES = _Construct("an effect at one time under a condition at another", _TEMPORAL)
CHOSEN_DURATION = _Construct("an effect that depends on how long was chosen", _TEMPORAL)


def refused(construct: _Construct, called: str, place: Place | None) -> UnsupportedConstructError:
    """The error for a construct that was found, called as it was written."""
    return UnsupportedConstructError(called, construct.meaning, construct.engines, place=place)


def refuse_forms(node: Node) -> None:
    """Raise `UnsupportedConstructError` for the first form in a condition or effect that is not evaluated.

    A predicate may have the name of such a form; the arguments of a form are groups.
    """
    if isinstance(node, Word):
        if node.folded() == "#t" and not node.quoted:
            raise refused(_CONTINUOUS, node.text, node.place)
        return
    head = node.head() or ""
    if head in _FORMS and any(isinstance(part, Group) for part in node.items):
        raise refused(_FORMS[head], head, node.place)
    for part in node.items:
        refuse_forms(part)
