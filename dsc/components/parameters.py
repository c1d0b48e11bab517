"""Parameters of components: the builder gives a range, the integrator a value, others change it at run time (S1.11).

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

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from dsc.model.ranges import Range, Who, written
from knowledge_base.errors import SchemaError, UnknownNameError
from knowledge_base.facts import Value
from knowledge_base.language.evaluation import holds
from knowledge_base.language.expression import free_variables
from knowledge_base.language.parser import parse_condition
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

Type = Literal["number", "text", "boolean"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """What the builder of a component says about one parameter.

    Attributes:
        type: `number`, `text` (any word) or `boolean`.
        default: its value if no profile says another; without one, a profile has to.
        least, most: the range of a number.
        among: the values of which it is one; empty means any.
        changed_by: who may change it, each one also what those after it may: `nobody`; a `profile`, before a run; an
            `operator`, while it goes on; the `rules` of plots, when something has gone wrong; `plots` anywhere.
    """

    type: Type
    default: Value | None = None
    least: float | None = None
    most: float | None = None
    among: tuple[Value, ...] = ()
    changed_by: Who = "plots"

    @property
    def range(self) -> Range:
        """The values that it may have."""
        return Range(self.type, self.least, self.most, self.among)

    def check(self, name: str, value: object) -> Value:
        """The value, if it fits; see `Range.check`."""
        return self.range.check(name, value)


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
            said = ", ".join(f"{name} is {written(values[name])}" for name in read)
            raise SchemaError(f"component '{component}' needs {text}, but {said}")


_NOTHING = Overlay(WorldState(Schema()))
