"""Checks of initial knowledge: values of functions that planning actions read."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.errors import Finding
from knowledge_base.errors import InputError
from knowledge_base.language.checking.vocabulary import ROOT_TYPE
from knowledge_base.language.syntax.effect import Form, parts_of_form
from knowledge_base.language.syntax.expression import Call
from knowledge_base.store import KnowledgeBase
from planning.model.domain import PlanningDomain

_MOST_LISTED = 3


def missing_values(domain: PlanningDomain, world: KnowledgeBase) -> Iterator[Finding]:
    """Yield a warning for each function that actions read and that has no initial value for some object.

    Of a function with several parameters, e.g. distances, only the lack of all values is a warning.
    """
    forms = [form for action in domain.actions.values() for form in (action.precondition, action.effect)]
    read = {call.function for form in forms for call in _calls(form)}
    for name in sorted(read & domain.schema.functions.keys()):  # another finding reports an undeclared one
        declared, known = domain.schema.functions[name], {one.args for one in world.values() if one.predicate == name}
        if declared.result not in {None, "number"}:
            continue
        missing = [] if known else [f"({' '.join([name, *['…'] * declared.arity])})"]
        if declared.arity == 1 and known:
            things = (one for kind in declared.parameters[0].types or (ROOT_TYPE,) for one in world.objects(kind))
            missing = [f"({name} {one})" for one in things if (one,) not in known]
        if missing:
            listed = ", ".join(missing[:_MOST_LISTED]) + (", …" if len(missing) > _MOST_LISTED else "")
            error = InputError(f"no initial value of {listed}, which counts as 0", place=declared.place)
            yield Finding(error, "initial-value", "set it in `values` of the initial knowledge", "warning")


def _calls(form: Form) -> Iterator[Call]:
    if isinstance(form, Call):
        yield form
    for part in parts_of_form(form):
        yield from _calls(part)
