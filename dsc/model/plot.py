"""The action plot: a state chart with an interface, reused as a black box (S0.1)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any, Literal, NamedTuple, Self

from pydantic import Field, PrivateAttr, field_validator, model_validator
from pydantic_core import PydanticCustomError

from dsc.events import CYCLE
from dsc.model import relations  # noqa: F401  declares them for all texts
from dsc.model.actions import ExternalAction, Internal, OfRobot, flat
from dsc.model.declarations import PlotParameter, PlotVariable, TypeText
from dsc.model.language import ConditionField, TermField, Written, constant
from dsc.model.plot_names import check_declarations, check_states, check_variables
from dsc.model.ranges import Who, refuse_change
from dsc.model.reading import LOCATED, FormPath
from dsc.model.robot import RobotSection
from dsc.model.rules import Handler, Names, Rule, told_apart
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    HistoryState,
    OrthogonalState,
    Region,
    State,
    SubmachineState,
)
from knowledge_base.errors import UnknownNameError
from knowledge_base.language.syntax.expression import Term
from knowledge_base.notebook import svg_of

Path = FormPath
"""Path of a part in the written form of a plot, e.g. `("states", "look", "on", "recognised")`."""


class AddedNames(NamedTuple):
    """Names that the expansion of rules and handlers added to a plot, each with words for people.

    Attributes:
        states: words of the added states by name; a region has the name `STATE:REGION`.
        events: words of the added internal events by name.
        variables: words of the added variables by name.
    """

    states: dict[str, str]
    events: dict[str, str]
    variables: dict[str, str]


class ActionPlot(Written):
    """An action plot: a state chart with parameters, variables, outcome events and rules.

    Attributes:
        name: name of the plot in the library (`plot`).
        parameters: input parameters by name.
        variables: variables of the plot by name.
        receives: accepted events from outside, e.g. from an operator, with the types of their attributes.
        outputs: typed values that the plot returns (S2.1). The plot assigns and reads them like variables. At the
            plot's end they become the attributes of the host state's `done` event.
        types: records by name: the types of their fields. Plots of one library share their records.
        robot: sensors, motors, constants, operations and activities of a robot that the plot drives in cycles (S3.3).
        emits: outcome events with the types of their attributes; the host state must handle every outcome event.
        when: condition under which the plot fits as a candidate of a dynamic state (bottom-up, S0.4).
        priority, utility, cost: terms by which dynamic states may choose among candidates that fit, see `choose`
            of `DynamicState` (S0.14).
        offers: names under which dynamic states find the plot as a candidate, see `Offers` (S0.4).
        implements: name of the planning action that the plot executes; both must have equal names of parameters.
        effects: treatment of the planning action's effects: `observed` before the next step, or `assumed`.
        confirm: seconds to wait until the effects are observed.
        states: top-level states by name; names must be unique in the whole plot.
        initial: name of the state to enter first; by default the first state in the file that is not a history.
        rules: contingency rules, in order of priority.
        handlers: event handlers, in order of priority.
        generated: whether the plot was made from a plan.
        dialect: `dsc`, or `scxml` for charts with features that only SCXML has: transitions across borders, history,
            events matched by prefix, internal actions in entry and exit.
    """

    name: str = Field(alias="plot", pattern=r"^[a-zA-Z_][\w\-#.]*$")
    about: str | None = None
    parameters: dict[str, PlotParameter] = Field(default_factory=dict)
    variables: dict[str, PlotVariable] = Field(default_factory=dict)
    outputs: dict[str, PlotVariable] = Field(default_factory=dict)
    types: dict[str, dict[str, TypeText]] = Field(default_factory=dict)
    receives: dict[str, dict[str, TypeText] | None] = Field(default_factory=dict)
    robot: RobotSection | None = None
    emits: dict[str, dict[str, TypeText] | None] = Field(default_factory=dict)
    when: ConditionField | None = None
    priority: TermField | None = None
    utility: TermField | None = None
    cost: TermField | None = None
    offers: Names = ()
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
    _words: AddedNames = PrivateAttr(default=AddedNames({}, {}, {}))
    _repr_svg_ = svg_of("plot")

    def scores(self) -> dict[str, Term]:
        """Return the declared terms by which dynamic states may choose the plot: `priority`, `utility` and `cost`."""
        found = {"priority": self.priority, "utility": self.utility, "cost": self.cost}
        return {name: term for name, term in found.items() if term is not None}

    def with_default(self, name: str, value: object, who: Who) -> ActionPlot:
        """Return a copy of the plot with another default of a parameter, set by the role `who`.

        Raises:
            UnknownNameError: the plot has no parameter of that name.
            InputError: the value is of another type or out of range, or `who` may not set the parameter.
        """
        if name not in self.parameters:
            raise UnknownNameError(f"plot '{self.name}' has no parameter '{name}'", found=name, valid=self.parameters)
        parameter, full = self.parameters[name], f"{self.name}.{name}"
        refuse_change(full, who, parameter.changed_by)
        changed = parameter.model_copy(update={"default": constant(parameter.range.check(full, value))})
        return self.model_copy(update={"parameters": {**self.parameters, name: changed}})

    @field_validator("rules")
    @classmethod
    def _require_distinct_rules(cls, rules: tuple[Rule, ...]) -> tuple[Rule, ...]:
        return told_apart(rules)

    @field_validator("handlers")
    @classmethod
    def _require_distinct_handlers(cls, handlers: tuple[Handler, ...]) -> tuple[Handler, ...]:
        return told_apart(handlers)

    @model_validator(mode="after")
    def _names_are_valid(self) -> ActionPlot:
        check_states(self.walk())
        paths: list[Path] = []
        for group in ("parameters", "variables", "outputs"):
            paths += [(group, name) for name in getattr(self, group)]
        for group in ("sensors", "motors", "constants", "activities") if self.robot is not None else ():
            paths += [("robot", group, name) for name in getattr(self.robot, group)]
        check_declarations(paths)
        for group, events in (("emits", self.emits), ("receives", self.receives)):
            for event, attributes in events.items():
                paths += [(group, event, name) for name in attributes or ()]
        check_variables(paths)
        return self

    @model_validator(mode="after")
    def _robot_is_of_dialect_dsc(self) -> ActionPlot:
        if self.robot is not None and self.dialect != "dsc":
            message = "a plot with a robot section is of dialect dsc"
            raise PydanticCustomError(LOCATED, message, {"path": ("robot",)})
        return self

    @property
    def all_variables(self) -> dict[str, PlotVariable]:
        """The variables, with the sensors, motors and constants of the robot section."""
        return self.variables if self.robot is None else {**self.variables, **self.robot.variables}

    @property
    def all_receives(self) -> dict[str, dict[str, TypeText] | None]:
        """The events from outside; a robot section adds `cycle`, whose attributes are the values of the sensors."""
        if self.robot is None:
            return self.receives
        return {**self.receives, CYCLE: {name: one.type for name, one in self.robot.sensors.items()}}

    def motor_values(self, action: OfRobot) -> dict[str, TermField]:
        """Return the values that an action assigns, see `RobotSection.motor_values`."""
        return (self.robot or RobotSection()).motor_values(action)

    def walk(self) -> Iterator[tuple[str, AnyState, Path]]:
        """Yield name, state and path of every state at any depth, in document order."""
        yield from _walk(self.states, ("states",))

    def actions(self) -> Iterator[ExternalAction | Internal]:
        """Yield the actions of all states, also those inside branches and blocks."""
        for _, state, _ in self.walk():
            if isinstance(state, State):
                for _, block in state.blocks():
                    yield from flat(block)

    def scopes(self) -> Iterator[Scope]:
        """Yield the scopes: the plot, then each composite state and region. A transition must not leave its scope."""
        yield self
        for _, state, _ in self.walk():
            if isinstance(state, CompositeState):
                yield state
            elif isinstance(state, OrthogonalState):
                yield from state.regions.values()

    def state(self, name: str) -> AnyState:
        """Return the state of that name, at any depth of the plot.

        Raises:
            KeyError: the plot has no such state.
        """
        return next(state for found, state, _ in self.walk() if found == name)

    def uses(self) -> frozenset[str]:
        """Return the names of all plots to which this plot refers by name."""
        return frozenset(name for _, name in self.references())

    def references(self) -> Iterator[tuple[Path, str]]:
        """Yield path and plot name of each reference to another plot."""
        for _, state, path in self.walk():
            if isinstance(state, SubmachineState) and not state.use.startswith("?"):
                yield (*path, "use"), state.use
            elif isinstance(state, DynamicState):
                yield from (((*path, "dynamic", number), name) for number, name in enumerate(state.candidates))
        for group, reactions in (("rules", [r.do for r in self.rules]), ("handlers", [h.do for h in self.handlers])):
            for number, do in enumerate(reactions):
                if do.use is not None:
                    yield (group, number, "do", "use"), do.use

    def to_form(self) -> dict[str, Any]:
        """Return the written form of the plot as plain data, which `ActionPlot.model_validate` reads."""
        form: dict[str, Any] = json.loads(self.text)
        return form

    @property
    def text(self) -> str:
        """The written form as JSON text, cached, because the trace records this text at each binding of the plot."""
        if self._text is None:
            self._text = json.dumps(self.model_dump(mode="json", by_alias=True, exclude_defaults=True))
        return self._text

    @property
    def digest(self) -> str:
        """Hash of the content as 12 hexadecimal digits; equal plots, with equal order of states, have equal digests."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:12]

    @property
    def words(self) -> AddedNames:
        """The words for the names that an expansion added. The written form omits them."""
        return self._words

    def with_words(self, names: AddedNames) -> ActionPlot:
        """Return a copy of the plot with the words for names that an expansion added."""
        copied = self.model_copy()
        copied._words = names  # noqa: SLF001  a plot, like this one
        return copied

    def __eq__(self, other: object) -> bool:
        """Compare the contents of two plots, without the places in their files."""
        return self is other or (isinstance(other, ActionPlot) and self.text == other.text)

    def __hash__(self) -> int:
        return hash(self.text)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with updated fields, as pydantic does; the copy drops the cached text and digest."""
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
"""A part of a plot that contains states and has an initial state."""


def initial_of(scope: Scope) -> str:
    """Return the name of a scope's initial state; in dialect `scxml` it may be at a deeper level (SCXML 3.3)."""
    proper = (name for name, state in scope.states.items() if not isinstance(state, HistoryState))
    return scope.initial or next(proper, next(iter(scope.states)))
