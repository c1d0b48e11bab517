"""Connectors: pseudostates that select a transition by conditions or by a value (S3.1). No connector is ever active."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from dsc.model.language import TermField
from dsc.model.reading import LOCATED, FormPath
from dsc.model.transitions import Transition, Transitions, TransitionSource, as_transition
from knowledge_base.facts import Value
from knowledge_base.language.syntax.expression import And, Comparison, Constant
from knowledge_base.spelling import TRUTH_VALUES, is_number

CHOICE = "choice"
"""Label of the transitions of connectors, which have no trigger."""


class Connector(TransitionSource):
    """A pseudostate on the way to a state; its transitions are tried in order, and the last one always holds."""

    @model_validator(mode="after")
    def _leads_on(self) -> Connector:
        for path, _, transition in self.placed_transitions():
            if transition.target is None:
                problem = "nothing rests in a connector; say with `to` where this leads"
                raise PydanticCustomError(LOCATED, problem, {"path": path})
        return self


class ChoiceState(Connector):
    """Selects by conditions: `choice: [{when: G, to: a}, z]`; the last branch has no `when`."""

    choice: Transitions = Field(min_length=1)

    def placed_transitions(self) -> Iterator[tuple[FormPath, str, Transition]]:
        """Yield the branches in order; paths are `("choice", number)`."""
        for number, branch in enumerate(self.choice):
            yield ("choice", number), CHOICE, branch


def _as_cases(value: Any) -> Any:
    if not isinstance(value, Mapping):
        return value
    cases = {_case_text(key): as_transition(case) for key, case in value.items()}
    if len(set(map(case_value, cases))) < len(value):  # to Python and YAML, 1 and true are the same key
        raise ValueError(f"two cases have the same value; found {', '.join(map(str, value))}")
    return cases


def _case_text(key: Any) -> str:
    """Return the key as text, with one spelling for each number, so that writing and reading keep the plot equal."""
    if isinstance(key, bool):
        return "true" if key else "false"
    if isinstance(key, str) and not is_number(key):
        return key
    number = case_value(key if isinstance(key, str) else repr(key))
    if isinstance(number, int) or (isinstance(number, float) and math.isfinite(number)):
        return repr(number)
    raise ValueError(f"a case is text, a number or a truth value; found {key!r}")


def case_value(key: str) -> Value:
    """Return the constant of a case's key: `1` a number, `true` a truth value, `"1"` and `cup` texts."""
    if is_number(key):
        return _number(key)
    quoted = len(key) > 1 and key[0] == key[-1] == '"'
    return TRUTH_VALUES.get(key, key[1:-1] if quoted else key)


def _number(text: str) -> int | float:
    try:
        return int(text)  # a large one has more digits than a float can hold
    except ValueError:
        number = float(text)
    return int(number) if number.is_integer() else number


class SelectState(Connector):
    """Selects by value: `select: ?event.kind`, `cases: {cup: wash, can: throw}`, `else: ask`.

    Attributes:
        select: the value to compare.
        cases: constant -> transition. Keys are kept as text, the only kind in JSON; `case_value` reads them. A `when`
            in a case must hold as well.
        otherwise: the transition for all other values (`else`).
    """

    select: TermField
    cases: Annotated[dict[str, Transition], BeforeValidator(_as_cases)] = Field(min_length=1)
    otherwise: Annotated[Transition, BeforeValidator(as_transition)] = Field(alias="else")

    def placed_transitions(self) -> Iterator[tuple[FormPath, str, Transition]]:
        """Yield the cases as guarded transitions, then the rest; paths are `("cases", key)` and `("else",)`."""
        for key, case in self.cases.items():
            value = case_value(key)
            # YAML reads a whole number or a truth value as a key of that type.
            place = value if isinstance(value, int) else key
            yield ("cases", place), CHOICE, self._guarded(value, case)
        yield ("else",), CHOICE, self.otherwise

    def _guarded(self, value: Value, case: Transition) -> Transition:
        is_case = Comparison("=", self.select, Constant(value))
        guard = is_case if case.guard is None else And((is_case, case.guard))
        return case.model_copy(update={"guard": guard})
