"""Values that a transition binds to variables, found by a condition (S4.3)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dsc.engine.situation import Bindings, Situation
from dsc.model.actions import Bind
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.expression import Term
from knowledge_base.language.syntax.text import to_text


def find_values(bind: Bind, situation: Situation, bindings: Bindings) -> Mapping[str, Any] | None:
    """Return the values of the variables by name; `None` if nothing fulfils the condition, except with `every`.

    Raises:
        InputError: the evaluation fails, or a value of `order_by` is not a number.
    """
    known = {name: value for name, value in bindings.items() if name not in bind.names}
    found = situation.answers(bind.condition, known)
    if bind.order_by:
        several = [*found]
        if len(several) > 1:
            several.sort(key=lambda one: tuple(_number(term, situation, {**known, **one}) for term in bind.order_by))
        found = iter(several)
    if bind.every:
        (name,) = bind.names
        return {name: [one[name] for one in found]}
    first = next(found, None)
    return None if first is None else {name: first[name] for name in bind.names}


def _number(term: Term, situation: Situation, bindings: Bindings) -> float:
    value = situation.value(term, bindings)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"`order_by` compares numbers, and {to_text(term)} is {value!r}", place=term.place)
    return value
