"""Parameters of components: the builder gives a range, the integrator a value, plots change it at run time (S1.11).

    class Base(Component):
        declares = {
            "speed": Parameter("number", default=0.5, least=0.1, most=1.5),
            "port": Parameter("text", changed_by="profile"),              # no default: a profile has to say it
            "wheels": Parameter("number", default=4, changed_by="nobody"),
        }
        relations = ("(<= ?speed (/ ?wheels 4))",)

Each component is an instance with values of its own, in `component.parameters`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.facts import Value
from knowledge_base.language.evaluation import holds
from knowledge_base.language.expression import free_variables
from knowledge_base.language.parser import parse_condition
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

Type = Literal["number", "text", "boolean"]
Who = Literal["nobody", "profile", "rules", "plots"]
_RANKS: tuple[Who, ...] = ("nobody", "profile", "rules", "plots")


@dataclass(frozen=True, slots=True)
class Parameter:
    """What the builder of a component says about one parameter.

    Attributes:
        type: `number`, `text` (any word) or `boolean`.
        default: its value if no profile says another; without one, a profile has to.
        least, most: the range of a number.
        among: the values of which it is one; empty means any.
        changed_by: who may change it, each one also what those before it may: `nobody`; a `profile`, before a run; the
            `rules` of plots, when something has gone wrong; `plots` anywhere.
    """

    type: Type
    default: Value | None = None
    least: float | None = None
    most: float | None = None
    among: tuple[Value, ...] = ()
    changed_by: Who = "plots"

    def may_be_changed_by(self, who: Who) -> bool:
        """Whether `who` may give it another value."""
        return _RANKS.index(who) <= _RANKS.index(self.changed_by)

    @property
    def allowed(self) -> str:
        """The range in words."""
        if self.among:
            return "one of " + ", ".join(map(_written, self.among))
        if self.least is not None and self.most is not None:
            return f"from {self.least:g} to {self.most:g}"
        if self.least is not None:
            return f"{self.least:g} or more"
        return f"{self.most:g} or less" if self.most is not None else f"a {self.type}"

    def check(self, name: str, value: object) -> Value:
        """The value, if it fits.

        Args:
            name: what the parameter is called in messages.
            value: what it shall be.

        Raises:
            InputError: it is of another type or out of range; the message has the range and the nearest word.
        """
        if isinstance(value, str | int | float | bool) and self._fits(value):
            return value
        message = f"'{name}' is {self.allowed}; found {_written(value)}"
        raise InputError(message, found=str(value), valid=map(str, self.among))

    def _fits(self, value: Value) -> bool:
        kind = "boolean" if isinstance(value, bool) else "text" if isinstance(value, str) else "number"
        if kind != self.type or (self.among and value not in self.among):
            return False
        if isinstance(value, float) and math.isnan(value):  # it is neither below nor above anything
            return False
        too_low = self.least is not None and not isinstance(value, str) and value < self.least
        too_high = self.most is not None and not isinstance(value, str) and value > self.most
        return not (too_low or too_high)


def known(component: str, name: str, declared: Mapping[str, Parameter]) -> Parameter:
    """What is declared about a parameter.

    Raises:
        UnknownNameError: the component has none of that name.
    """
    if name not in declared:
        message = f"component '{component}' has no parameter '{name}'"
        raise UnknownNameError(message, found=name, valid=declared)
    return declared[name]


def check_relations(component: str, relations: Iterable[str], values: Mapping[str, Value]) -> None:
    """Relations between the parameters of a component; those about a parameter without value say nothing yet.

    Args:
        component: its name, for messages.
        relations: conditions over its parameters, as `(<= ?speed (* 0.5 ?cycle))`.
        values: the parameters that have a value.

    Raises:
        SchemaError: one does not hold; the message has the values.
    """
    for text in relations:
        condition = parse_condition(text)
        read = sorted(free_variables(condition))
        if all(name in values for name in read) and not holds(condition, _NOTHING, values):
            said = ", ".join(f"{name} is {_written(values[name])}" for name in read)
            raise SchemaError(f"component '{component}' needs {text}, but {said}")


_NOTHING = Overlay(WorldState(Schema()))


def _written(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else str(value)
