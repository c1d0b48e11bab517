"""Contingency rules and event handlers: reactions of a plot in addition to its transitions (S1.4, S1.14)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Annotated, TypeVar

from pydantic import BeforeValidator, Field, field_validator, model_validator

from dsc.events import LED_AWAY
from dsc.model.actions import Configure, Send, Switch, Trigger
from dsc.model.language import ByKey, ConditionField, EffectField, Frozen, TermField
from dsc.model.transitions import as_tuple

RETRY, CONTINUE, REPLAN, GIVE_UP, ENTER = "retry", "continue", "replan", "give_up", "enter"
RESUME = "resume"
"""Continuation after an outcome of a handler's plot: as after `done`, return to the previous activity."""

RESPONSES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "on": (RETRY, CONTINUE, REPLAN, GIVE_UP),
        "before": (ENTER, CONTINUE, REPLAN, GIVE_UP),
        "after": (CONTINUE, RETRY, REPLAN, GIVE_UP),
    }
)
"""Continuations that need no named state, by the place of the rule; the first one is the default."""

STEP = "step."
"""Prefix with which a rule reads a step's argument, e.g. `?step.item`."""

Names = Annotated[tuple[str, ...], BeforeValidator(as_tuple)]
Command = Annotated[Configure | Switch | Send, ByKey()]
"""A command to a component, without a result."""
Commands = Annotated[tuple[Command, ...], BeforeValidator(as_tuple)]


class Reaction(Frozen):
    """Actions that a rule or handler executes, in the order of the attributes.

    Attributes:
        tell: change of the knowledge base.
        command: commands to components: set a parameter, switch a mode, send a message.
        use, arguments: name of the plot to run, and values for its parameters (`with`).
        on: continuation after each outcome of the plot other than `done`, by the outcome.
    """

    tell: EffectField | None = None
    command: Commands = ()
    use: str | None = None
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")
    on: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _has_outcomes_of_a_plot(self) -> Reaction:
        if self.on and self.use is None:
            raise ValueError("`on` names outcomes of the plot under `use`; here is no `use`")
        return self

    @property
    def acts(self) -> bool:
        """Whether the reaction needs a state, because it has commands or runs a plot."""
        return bool(self.command or self.use)


class Response(Reaction):
    """The response of a rule: actions and a continuation.

    Attributes:
        then: the continuation; with `use`, after the plot is done. See `Rule.then` for the default. `retry` enters the
            step again, which chooses among its candidates. `continue` treats the step as done. `enter` enters the step
            after a `before` rule. `replan` and `abandon` concern the plan. Any other word is a state's name.
        passed: arguments for the step or state that is entered next (`pass`); they override that state's `with`.
        limit: upper bound of this rule's responses for one state while the plot is active; `None` means the default.
    """

    then: str | None = None
    passed: dict[str, TermField] = Field(default_factory=dict, alias="pass")
    limit: int | None = Field(default=None, ge=1, strict=True)


class Rule(Frozen):
    """A contingency rule: a plot's response to an outcome event of a step, or before or after a step (S1.4).

    A step is a state that contains another plot. A rule refers to a step by the state's name, or by the planning action
    that all possible plots of the step implement. If the rule refers to steps, `?step.item` reads a step's argument.

    Attributes:
        on: outcome event of a step.
        before, after: steps before or after which the response is inserted; a `before` rule may skip the step.
        when: condition over the event's attributes, the step's arguments and the knowledge base.
        of: steps to which an `on` rule applies; empty means all steps.
        do: response of the rule.
        priority, preempt: as for a state, for the skills of the response.
        name: name of the rule in records and reports, see `label`.
    """

    name: str | None = None
    on: str | None = None
    before: Names = ()
    after: Names = ()
    when: ConditionField | None = None
    of: Names = ()
    do: Response
    priority: float | None = Field(default=None, strict=True)
    preempt: bool = Field(default=False, strict=True)

    @model_validator(mode="after")
    def _answers_in_one_place(self) -> Rule:
        given = [key for key in RESPONSES if getattr(self, key)]
        if len(given) != 1:
            found = f"; found {' and '.join(given)}" if given else ""
            raise ValueError(f"a rule has one of the keys on, before and after{found}")
        if self.of and self.on is None:
            raise ValueError(f"`of` goes with `on`; after `{given[0]}` the steps are named already")
        return self

    @property
    def place(self) -> str:
        """The place of the rule: `on`, `before` or `after`."""
        return next(key for key in RESPONSES if getattr(self, key))

    @property
    def steps(self) -> tuple[str, ...]:
        """The steps to which the rule applies; empty means all steps."""
        return self.of or self.before or self.after

    @property
    def then(self) -> str:
        """The continuation: the written one, or the default for the rule's place."""
        return self.do.then or RESPONSES[self.place][0]

    @property
    def continuations(self) -> tuple[Rule, ...]:
        """The rule, and for each other outcome of its plot the rule with the continuation after this outcome."""
        return (self, *map(self.after_outcome, self.do.on))

    def after_outcome(self, outcome: str) -> Rule:
        """Return the rule with the continuation after an outcome of its plot, which passes no arguments."""
        do = self.do.model_copy(update={"then": self.do.on[outcome], "passed": {}, "on": {}})
        return self.model_copy(update={"do": do, "name": self.name and f"{self.name}, {do.then}"})

    @property
    def leads_away(self) -> bool:
        """Whether the continuation is a named state; a plan has no such state, so the rule leaves the plan."""
        return self.then not in RESPONSES[self.place]

    @property
    def outcome(self) -> str:
        """The outcome event with which the rule leaves a plan; it carries the arguments for the named state."""
        return f"{LED_AWAY}{self.then}" + (f"({','.join(sorted(self.do.passed))})" if self.do.passed else "")

    @property
    def label(self) -> str:
        """The name of the rule; by default the place and the response, e.g. `grasp_failed: reposition, retry`."""
        if self.name is not None:
            return self.name
        about = self.on or f"{self.place} {', '.join(self.steps)}"
        then = None if self.then == RESPONSES[self.place][0] and self.on is None and self.do.acts else self.then
        return f"{about}: " + ", ".join(part for part in (self.do.use, then) if part)


class Handler(Frozen):
    """An event handler: a plot's response to an event at any time while the plot is active (S1.14).

    A rule responds to the outcome of a step and decides the continuation. After a handler, the plot continues as
    before: after an interrupting handler, the interrupted state is entered again. Under `on`, the word `resume` asks
    for the same after an outcome of the handler's plot. Any other word is a state at the top level of the plot, which
    is entered instead.

    Attributes:
        on: name of an event that the plot `receives`, that a part of the plot fires, or that `listen` activates.
        listen: action that activates a component's event while the plot is active.
        when: condition over the event's attributes, the plot's variables and the knowledge base.
        interrupt: whether the active state is exited and afterwards entered again; if not, the handler runs in
            parallel.
        do: actions of the handler.
        priority, preempt: as for a state, for the skills of the actions; by default, they precede those of the plot.
        name: name of the handler in records and reports, see `label`.
    """

    name: str | None = None
    on: str
    listen: Trigger | None = None
    when: ConditionField | None = None
    interrupt: bool = Field(default=False, strict=True)
    do: Reaction
    priority: float | None = Field(default=None, strict=True)
    preempt: bool = Field(default=False, strict=True)

    @field_validator("do", mode="before")
    @classmethod
    def _refuse_then(cls, do: object) -> object:
        if isinstance(do, Mapping) and "then" in do:
            raise ValueError(
                "`then` belongs to a rule: after a handler the plot continues; see `rules` and `interrupt`"
            )
        return do

    @property
    def label(self) -> str:
        """The name of the handler; by default the event and the used plot, e.g. `handler low_bat: announce`."""
        return self.name or f"handler {self.on}" + (f": {self.do.use}" if self.do.use else "")


_Responding = TypeVar("_Responding", Rule, Handler)


def told_apart(responses: Iterable[_Responding]) -> tuple[_Responding, ...]:
    """Return rules or handlers with unique labels: further ones with an equal label get a name with a number."""
    count: Counter[str] = Counter()
    found: list[_Responding] = []
    for one in responses:
        count[one.label] += 1
        number = count[one.label]
        found.append(one if number == 1 else one.model_copy(update={"name": f"{one.label} ({number})"}))
    return tuple(found)
