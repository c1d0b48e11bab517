"""What a plan step may take hold of while it is carried out: components, and time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from dsc.dynamic.library import Library
from dsc.events import FAILURES
from dsc.model.actions import Configure, Switch, Trigger, component_of, flat
from dsc.model.plot import ActionPlot
from dsc.model.rules import Rule
from dsc.model.states import DynamicState, State, SubmachineState
from dsc.sequencer.dispatcher import DEFAULT_WITHIN
from knowledge_base.facts import Value
from knowledge_base.language.expression import And, Comparison, Constant, Expression, substitute_term


@dataclass(frozen=True, slots=True)
class Usage:
    """What plots may use, in whatever way they run.

    Attributes:
        components: names of the components that they start, configure or switch.
        anything: they may use others as well: they plan, or bind a plot that is a value.
        seconds: the sum of the time limits of their skills.
    """

    components: frozenset[str] = frozenset()
    anything: bool = False
    seconds: float = 0.0

    def clashes(self, other: Usage, shared: Iterable[str] = ()) -> bool:
        """Whether both may need one component at once that is not among the `shared` ones."""
        return self.anything or other.anything or bool((self.components & other.components).difference(shared))


def usage(plots: Iterable[ActionPlot], library: Library, rules: Iterable[Rule] = ()) -> Usage:
    """What the plots may use, and what the rules have for their outcomes or put before and after them.

    Raises:
        UnknownNameError: a plot uses one that is not there.
    """
    found: dict[str, ActionPlot] = {}
    waiting = list(plots)
    applied = _applied(rules, waiting)
    waiting += [library.plot(rule.do.use) for rule in applied if rule.do.use]
    while waiting:
        plot = waiting.pop()
        if plot.name not in found:
            found[plot.name] = plot
            waiting += [library.plot(name) for name in sorted(plot.uses())]
    actions = [action for plot in found.values() for action in _actions(plot)]
    actions += [one for rule in applied for one in rule.do.command if isinstance(one, Configure | Switch)]
    names = {name for action in actions if (name := component_of(action)) is not None}
    limits = [action.within or DEFAULT_WITHIN for action in actions if isinstance(action, Trigger)]
    return Usage(frozenset(names), any(map(_is_open, found.values())), sum(limits))


def _applied(rules: Iterable[Rule], plots: Sequence[ActionPlot]) -> list[Rule]:
    """The rules that may have something to do with a step over these plots."""
    emitted = FAILURES.union(*(plot.emits for plot in plots))
    actions = {plot.implements for plot in plots}
    named = [rule for rule in rules if not rule.steps or actions.intersection(rule.steps)]
    return [rule for rule in named if rule.on is None or rule.on in emitted]


def fitting(plots: Iterable[ActionPlot], bindings: Mapping[str, Value]) -> tuple[ActionPlot, ...]:
    """The plots whose condition does not rule out these arguments, whatever the world is like; all if none does not."""
    plots = tuple(plots)
    return tuple(plot for plot in plots if plot.when is None or not _is_false(plot.when, bindings)) or plots


def _is_false(e: Expression, bindings: Mapping[str, Value]) -> bool:
    match e:
        case And(parts):
            return any(_is_false(part, bindings) for part in parts)
        case Comparison("=" | "!=" as operator):
            sides = [substitute_term(side, bindings) for side in (e.left, e.right)]
            values = [side.value for side in sides if isinstance(side, Constant)]
            return len(values) == len(sides) and (values[0] == values[1]) is not (operator == "=")
        case _:
            return False


def _actions(plot: ActionPlot) -> Iterable[Trigger | Configure | Switch]:
    blocks = [actions for _, state, _ in plot.walk() if isinstance(state, State) for _, actions in state.blocks()]
    found = (action for block in blocks for action in flat(block))
    return [action for action in found if isinstance(action, Trigger | Configure | Switch)]


def _is_open(plot: ActionPlot) -> bool:
    states = [state for _, state, _ in plot.walk()]
    planned = any(isinstance(state, DynamicState) and state.goal is not None for state in states)
    return planned or any(isinstance(state, SubmachineState) and state.use.startswith("?") for state in states)
