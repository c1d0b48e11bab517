"""The action plot: a state chart with an interface, reused as a black box (S0.1)."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Container, Iterable, Iterator, Mapping
from typing import Any, Literal, Self

from pydantic import Field, PrivateAttr, model_validator
from pydantic_core import PydanticCustomError

from dsc.model.language import ConditionField, Frozen, Setting, TermField, Written, constant
from dsc.model.ranges import Range, Who, refuse_change
from dsc.model.reading import LOCATED, FormPath
from dsc.model.rules import Handler, Rule
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    HistoryState,
    OrthogonalState,
    Region,
    SubmachineState,
)
from knowledge_base.errors import UnknownNameError
from knowledge_base.spelling import is_plain_name

Path = FormPath
"""Path of a part in a plot's form, e.g. `("states", "look", "on", "recognised")`."""


_STATE_NAME = re.compile(r"[^/#][^/]*")
# Paths contain state names between slashes; in a stored state, a name that begins with # is a region's index.


class _Declaration(Frozen):
    """A typed name; the type alone is its short form."""

    type: str

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, value: Any) -> Any:
        return {"type": value} if isinstance(value, str) else value


class PlotParameter(_Declaration):
    """A one-way parameter with its role (S1.11).

    Attributes:
        type: a type of the knowledge base's schema, or `number`, `boolean`, `text`, `symbol`.
        default: its value without another setting.
        least, most: the range of a number.
        among: the allowed values; empty means any.
        changed_by: the last role that may set another value; all roles before it may, too. In order: `nobody`;
            `profile`, before a run; `operator`, during a run; `rules` and handlers that use the plot; all `plots` that
            use it.
    """

    default: TermField | None = None
    least: float | None = Field(default=None, strict=True)
    most: float | None = Field(default=None, strict=True)
    among: tuple[Setting, ...] = ()
    changed_by: Who = "plots"

    @property
    def range(self) -> Range:
        """The allowed values."""
        return Range(self.type, self.least, self.most, self.among)

    @property
    def bounded(self) -> bool:
        """Return whether its range is narrower than its type."""
        return self.least is not None or self.most is not None or bool(self.among)


class PlotVariable(_Declaration):
    """A variable or output in the plot's scope; it ends with the plot (S0.7)."""

    initial: TermField | None = None


class ActionPlot(Written):
    """An action plot.

    Attributes:
        name: its name in the library (`plot`).
        parameters: input values.
        variables: its own variables.
        receives: events from outside (an operator, a user interface) that it accepts, with their attributes.
        outputs: typed values that it returns (S2.1). Inside, they are assigned and read like variables. At the final
            state they become the attributes of the holder's `done`.
        emits: outcome events with their attributes and types; the holder of the plot must wire them all.
        when: as a candidate, the condition under which it fits (bottom-up, S0.4).
        implements: the planning action that it executes; its parameters are named as that action's.
        effects: whether the action's effects must be `observed` before the next step, or are `assumed`.
        confirm: seconds to wait for them to be observed.
        states: the top-level states by name; names are unique in the whole plot.
        initial: the state to enter first; by default the first one.
        rules: contingency rules, in order of priority.
        handlers: event handlers, in order of priority.
        generated: whether it was made from a plan.
        dialect: `dsc`, or `scxml` for charts with features of SCXML alone: transitions across borders, history,
            events matched by prefix, internal actions in entry and exit.
    """

    name: str = Field(alias="plot", pattern=r"^[a-zA-Z_][\w\-#.]*$")
    about: str | None = None
    parameters: dict[str, PlotParameter] = Field(default_factory=dict)
    variables: dict[str, PlotVariable] = Field(default_factory=dict)
    outputs: dict[str, PlotVariable] = Field(default_factory=dict)
    receives: dict[str, dict[str, str] | None] = Field(default_factory=dict)
    emits: dict[str, dict[str, str] | None] = Field(default_factory=dict)
    when: ConditionField | None = None
    implements: str | None = None
    effects: Literal["observed", "assumed"] = "observed"
    confirm: float = Field(default=5.0, gt=0, strict=True)
    initial: str | None = None
    states: dict[str, AnyState] = Field(min_length=1)
    rules: tuple[Rule, ...] = ()
    handlers: tuple[Handler, ...] = ()
    generated: bool = Field(default=False, strict=True)
    dialect: Literal["dsc", "scxml"] = "dsc"
    _text: str | None = PrivateAttr(default=None)

    def with_default(self, name: str, value: object, who: Who) -> ActionPlot:
        """Return the plot with another default of a parameter.

        Raises:
            UnknownNameError: it has no such parameter.
            InputError: the value is of another type or out of range, or `who` may not set it.
        """
        if name not in self.parameters:
            raise UnknownNameError(f"plot '{self.name}' has no parameter '{name}'", found=name, valid=self.parameters)
        parameter, full = self.parameters[name], f"{self.name}.{name}"
        refuse_change(full, who, parameter.changed_by)
        changed = parameter.model_copy(update={"default": constant(parameter.range.check(full, value))})
        return self.model_copy(update={"parameters": {**self.parameters, name: changed}})

    @model_validator(mode="after")
    def _names_are_unique(self) -> ActionPlot:
        seen: set[str] = set()
        for name, _, path in self.walk():
            if _STATE_NAME.fullmatch(name) is None:
                wrong = "'{name}' is not a name for a state: it has a slash, begins with # or is empty"
                raise PydanticCustomError(LOCATED, wrong, {"name": name, "path": path})
            if name in seen:
                twice = "two states are named '{name}'; names are unique in a plot"
                raise PydanticCustomError(LOCATED, twice, {"name": name, "path": path})
            seen.add(name)
        return self

    @model_validator(mode="after")
    def _variables_can_be_written(self) -> ActionPlot:
        for path in self._variable_paths():
            name = path[-1]
            if not is_plain_name(str(name)):
                wrong = "'{name}' is not a name for a variable: the language folds names to lower case"
                raise PydanticCustomError(LOCATED, wrong, {"name": name, "path": path})
        self._is_declared_once("variable", self.variables, {"parameter": self.parameters})
        self._is_declared_once("output", self.outputs, {"parameter": self.parameters, "variable": self.variables})
        return self

    def _is_declared_once(self, kind: str, names: Iterable[str], others: Mapping[str, Container[str]]) -> None:
        for name in names:
            for other, declared in others.items():
                if name in declared:
                    context = {"name": name, "other": other, "kind": kind, "path": (f"{kind}s", name)}
                    raise PydanticCustomError(LOCATED, "'{name}' is declared twice: as {other} and as {kind}", context)

    def _variable_paths(self) -> Iterator[Path]:
        """Yield the paths of all names that conditions and terms read as `?name` or `?event.name`."""
        yield from (("parameters", name) for name in self.parameters)
        yield from (("variables", name) for name in self.variables)
        yield from (("outputs", name) for name in self.outputs)
        for group, events in (("emits", self.emits), ("receives", self.receives)):
            yield from ((group, event, name) for event, attributes in events.items() for name in attributes or ())

    def walk(self) -> Iterator[tuple[str, AnyState, Path]]:
        """Yield all states in document order, with their names and paths."""
        yield from _walk(self.states, ("states",))

    def scopes(self) -> Iterator[Scope]:
        """Yield the scopes: the plot, each composite and region; each transition stays in one."""
        yield self
        for _, state, _ in self.walk():
            if isinstance(state, CompositeState):
                yield state
            elif isinstance(state, OrthogonalState):
                yield from state.regions.values()

    def state(self, name: str) -> AnyState:
        """Return the state of that name anywhere in the plot.

        Raises:
            KeyError: the plot has no such state.
        """
        return next(state for found, state, _ in self.walk() if found == name)

    def uses(self) -> frozenset[str]:
        """Return the names of the plots it refers to."""
        return frozenset(name for _, name in self.references())

    def references(self) -> Iterator[tuple[Path, str]]:
        """Yield each reference to another plot: its path and the plot's name."""
        for _, state, path in self.walk():
            if isinstance(state, SubmachineState) and not state.use.startswith("?"):
                yield (*path, "use"), state.use
            elif isinstance(state, DynamicState):
                yield from (((*path, "dynamic", number), name) for number, name in enumerate(state.dynamic))
        for group, reactions in (("rules", [r.do for r in self.rules]), ("handlers", [h.do for h in self.handlers])):
            for number, do in enumerate(reactions):
                if do.use is not None:
                    yield (group, number, "do", "use"), do.use

    def to_form(self) -> dict[str, Any]:
        """Return the plot as plain data in its written form; `ActionPlot.model_validate` reads it."""
        form: dict[str, Any] = json.loads(self.text)
        return form

    @property
    def text(self) -> str:
        """`to_form` as JSON, cached, because a trace needs it whenever a plot is bound."""
        if self._text is None:
            self._text = json.dumps(self.model_dump(mode="json", by_alias=True, exclude_defaults=True))
        return self._text

    @property
    def digest(self) -> str:
        """A hash of the content, including the order of states: equal plots have equal digests."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:12]

    def __eq__(self, other: object) -> bool:
        """Compare the contents, without the places in text."""
        return self is other or (isinstance(other, ActionPlot) and self.text == other.text)

    def __hash__(self) -> int:
        return hash(self.text)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """See pydantic; the copy drops the cached text and digest."""
        copied = super().model_copy(update=update, deep=deep)
        copied._text = None  # noqa: SLF001  a plot, like this one
        return copied


def _walk(states: Mapping[str, AnyState], path: Path) -> Iterator[tuple[str, AnyState, Path]]:
    for name, state in states.items():
        here = (*path, name)
        yield name, state, here
        if isinstance(state, CompositeState):
            yield from _walk(state.states, (*here, "states"))
        elif isinstance(state, OrthogonalState):
            for region_name, region in state.regions.items():
                yield from _walk(region.states, (*here, "regions", region_name, "states"))
            yield from ((each, history, (*here, "connectors", each)) for each, history in state.connectors.items())


Scope = ActionPlot | CompositeState | Region
"""A part that contains states and has an initial one."""


def initial_of(scope: Scope) -> str:
    """Return the name of the state to enter first; in dialect `scxml` it may be deeper inside (SCXML 3.3)."""
    proper = (name for name, state in scope.states.items() if not isinstance(state, HistoryState))
    return scope.initial or next(proper, next(iter(scope.states)))
