"""Texts in drawings: interface, rules and handlers of plots, and short and full captions of edges and states."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from dsc.drawing.layout import TextStyle, pack
from dsc.events import TIMERS
from dsc.model.actions import (
    Assign,
    Bind,
    Block,
    Choose,
    Configure,
    Emit,
    ExternalAction,
    Internal,
    Log,
    Perform,
    Send,
    StartActivity,
    StopActivity,
    Switch,
    Tell,
    Trigger,
    Unwire,
    Wire,
    Withdraw,
)
from dsc.model.declarations import PlotParameter, PlotVariable
from dsc.model.language import term_text
from dsc.model.plot import ActionPlot
from dsc.model.robot import RobotSection
from dsc.model.rules import Handler, Reaction, Rule
from dsc.model.states import DynamicState, State
from dsc.model.transitions import CHOICE, SelectState, TimedTransition, Transition, TransitionSource, case_value
from knowledge_base.language.syntax.expression import TRUE, And, Comparison, Constant, Expression, Term, Variable
from knowledge_base.language.syntax.text import to_text
from knowledge_base.spelling import value_text

WIDTH = 190.0
"""Largest width of a caption line at an edge, in pixels."""
ALWAYS = "always"
COUNTER_PREFIX = "tries_"
"""Prefix of the variables in which expanded rules count their responses."""


@dataclass(frozen=True, slots=True)
class Caption:
    """Caption of one or more triggers with equal guard and actions: short lines, and the full text on one line."""

    lines: tuple[str, ...]
    full: str
    rule: bool

    @property
    def style(self) -> TextStyle:
        """The style of the caption's text."""
        return TextStyle.RULE if self.rule else TextStyle.LABEL


@dataclass(frozen=True, slots=True)
class Labelled:
    """A transition, its trigger in words, and whether a transition with an equal trigger is tried before it."""

    trigger: str
    transition: Transition
    otherwise: bool


def labelled(source: TransitionSource) -> list[Labelled]:
    """Return the transitions of a state or connector in the order in which they are tried."""
    seen: set[str] = set()
    result = []
    for event, transition in source.transitions():
        result.append(Labelled(_trigger(event, transition), transition, event in seen and event not in TIMERS))
        seen.add(event)
    return result


def labelled_by_value(source: TransitionSource) -> list[Labelled]:
    """Return the transitions as `labelled` does; a case of a `select` shows only its value.

    The connector's box shows the selected term.
    """
    if not isinstance(source, SelectState):
        return labelled(source)
    cases = [Labelled(value_text(case_value(key)), case, otherwise=False) for key, case in source.cases.items()]
    return [*cases, Labelled("", source.otherwise, otherwise=True)]


def _trigger(event: str, transition: Transition) -> str:
    if isinstance(transition, TimedTransition):
        return f"{event} {seconds_text(transition.seconds)}"
    return "" if event in {ALWAYS, CHOICE} else event


def seconds_text(seconds: Term) -> str:
    """Return a duration in seconds as text, e.g. `0.5 s` or `(* 2 ?n) s`."""
    match seconds:
        case Constant(int() | float() as value):
            return f"{value:g} s"
        case other:
            return f"{to_text(other)} s"


def captions(transitions: Iterable[Labelled], *, terse: bool = False) -> list[Caption]:
    """Return the captions of one edge; triggers with equal guards and actions share a caption.

    If `terse`, only the full text contains assignments and `[else]`; generated plots have many of them.
    """
    groups: dict[tuple[object, ...], list[Labelled]] = {}
    for one in transitions:
        groups.setdefault(_rest(one, terse=terse), []).append(one)
    return [caption for group in groups.values() if (caption := _caption(group, terse=terse)).full]


def _rest(one: Labelled, *, terse: bool) -> tuple[object, ...]:
    """Return all parts of a caption except the trigger, as the key of a shared caption."""
    return _guard(one, terse=terse), one.transition.rule, one.transition.internal, _brief(one.transition, terse=terse)


def _guard(one: Labelled, *, terse: bool) -> str:
    guard = one.transition.guard
    if (binding := one.transition.binding) is not None:
        return f"[{action_text(binding)}]"
    if guard is not None and guard != TRUE:
        return f"[{to_text(guard)}]"
    return "[else]" if one.otherwise and not (terse and one.trigger) else ""


def _brief(transition: Transition, *, terse: bool) -> tuple[str, ...]:
    shown = [action for action in _effect(transition) if not (terse and isinstance(action, Assign))]
    return (*(action_text(action, brief=True) for action in shown), *_argument_texts(transition, brief=True))


def _effect(transition: Transition) -> list[Internal]:
    """Return the actions of a transition without its binding, which the guard shows."""
    return [action for action in transition.effect if not (isinstance(action, Bind) and not action.every)]


def _argument_texts(transition: Transition, *, brief: bool = False) -> list[str]:
    """Return texts of the arguments that a transition passes to its target's plot, and of the histories it clears."""
    passed = ", ".join(name if brief else f"{name} = {term_text(value)}" for name, value in transition.passed.items())
    cleared = ", ".join(transition.clear)
    return [f"{word} {what}" for word, what in (("pass", passed), ("clear", cleared)) if what]


def _caption(group: list[Labelled], *, terse: bool) -> Caption:
    first = group[0]
    rule = first.transition.rule
    if rule is not None:
        words = [*rule.split(" "), _rule_guard(first.transition.guard)]
    else:
        triggers = list(dict.fromkeys(one.trigger for one in group if one.trigger))
        actions = _brief(first.transition, terse=terse)
        kind = _kind(first.transition)
        words = [*_list_lines(triggers), _guard(first, terse=terse), kind, *_list_lines(actions, ";", "/ ")]
    lines = pack([word for word in words if word], TextStyle.LABEL, WIDTH)
    return Caption(tuple(lines), "\n".join(filter(None, map(full_text, group))), rule is not None)


def full_text(one: Labelled, *, trigger: bool = True) -> str:
    """Return the full text of a transition; `trigger=False` omits the trigger."""
    effects = "; ".join([*map(action_text, _effect(one.transition)), *_argument_texts(one.transition)])
    rule = one.transition.rule
    parts = [
        one.trigger if trigger else "",
        _guard(one, terse=False),
        _kind(one.transition),
        f"/ {effects}" if effects else "",
        f"(rule: {rule})" if rule else "",
    ]
    return " ".join(part for part in parts if part)


def _kind(transition: Transition) -> str:
    """Return `{internal}` as in UML if the transition does not exit its source."""
    return "{internal}" if transition.internal and transition.target is not None else ""


def _list_lines(words: Sequence[str], separator: str = ",", before: str = "") -> list[str]:
    if not words:
        return []
    return (before + f"{separator}\n".join(words)).split("\n")


def _rule_guard(guard: Expression | None) -> str:
    """Return the text of a rule's guard, with the limit of its counter in words."""
    parts = guard.parts if isinstance(guard, And) else () if guard is None else (guard,)
    words: list[str] = []
    for part in parts:
        match part:
            case Comparison("<", Variable(name), Constant(limit)) if name.startswith(COUNTER_PREFIX):
                words.insert(0, f"at most {limit} times")
            case _:
                words.append(to_text(part))
    return f"[{', '.join(words)}]" if words else ""


def block_texts(state: State, emits: Container[str] = ()) -> list[str]:
    """Return a line for each action of a state, e.g. `entry / arm.grasp(?item)`.

    The new name of an event follows, as in `as name`. For one of the outcomes `emits` of the plot it is `as ^name`,
    since the states around the plot may see it (S0.6).
    """
    words = {"entry": "entry", "exit": "exit", "on_break": "break"}
    return [
        f"{words[key]} / {action_text(action)}{_alias_text(action, emits)}"
        for key, actions in state.blocks()
        for action in actions
    ]


def _alias_text(action: Internal | ExternalAction, emits: Container[str]) -> str:
    if not isinstance(action, Trigger) or not action.names:
        return ""
    return " as " + ", ".join(f"^{name}" if name in emits else name for name in action.names.values())


def action_text(action: Internal | ExternalAction, *, brief: bool = False) -> str:  # noqa: PLR0911  # a table by kind
    """Return an action in the notation of state charts, e.g. `^event`, `name := value` or `component.skill(…)`.

    If `brief`, the attributes of fired events are omitted.
    """
    match action:
        case Emit(emit=event, arguments=arguments):
            later = "" if action.delay is None else f" after {to_text(action.delay)} s"
            return f"^{event}" + (_values(arguments) if arguments and not brief else "") + later
        case Bind(names=names, condition=condition, every=every):
            return f"{', '.join(names)} {':= all' if every else '∈'} {to_text(condition)}"
        case Assign(assign=values):
            return ", ".join(f"{name} := {term_text(value)}" for name, value in values.items())
        case Perform(perform=name):
            return name
        case StartActivity() | StopActivity():
            name, active = action.change
            return f"start({name})" if active else f"stop({name})"
        case Tell(tell=effect):
            return f"tell {to_text(effect)}"
        case Withdraw(withdraw=sent):
            return f"withdraw {to_text(sent)}"
        case Log(log=parts):
            return f"log {' '.join(map(to_text, parts))}"
        case Choose(condition=condition, then=then, otherwise=otherwise):
            branches = [", ".join(map(action_text, branch)) for branch in (then, otherwise)]
            return f"if {to_text(condition)} {{{branches[0]}}} else {{{branches[1]}}}"
        case Block(block=inside):
            return f"{{{', '.join(map(action_text, inside))}}}"
        case _:
            return _command_text(action)


def _command_text(action: ExternalAction) -> str:
    match action:
        case Trigger(trigger=skill, arguments=arguments, within=within):
            return f"{skill}{_values(arguments)}" + (f" within {within:g} s" if within is not None else "")
        case Configure(set=parameter, to=value):
            return f"{parameter} := {term_text(value)}"
        case Send(send=port, arguments=arguments):
            return f"{port}!{_values(arguments)}"
        case Switch(switch=component, to=mode):
            return f"{component} → {mode}"
        case Wire(wire=port, to=provider):
            return f"{port} ⇠ {term_text(provider)}"
        case Unwire(unwire=port):
            return f"unwire {port}"


def _values(arguments: Mapping[str, Term]) -> str:
    return "(" + ", ".join(term_text(value) for value in arguments.values()) + ")"


def choice_text(state: DynamicState) -> str:
    """Return how a dynamic state chooses, as ` by utility`; empty for a choice by order."""
    return "" if state.choose == "order" else f" by {state.choose}"


def content_text(use: str, arguments: Mapping[str, Term]) -> str:
    """Return, as text, the name and arguments of a plot that a state uses."""
    return use + (_values(arguments) if arguments else "")


def signature(plot: ActionPlot) -> str:
    """Return the plot's name and parameters as text."""
    return f"{plot.name}({_declaration_text(plot.parameters)})" if plot.parameters else plot.name


def facts(plot: ActionPlot) -> list[str]:
    """Return the plot's interface except name and parameters, one line for each fact."""
    return [
        f"{what}: {text}"
        for what, text in (
            ("implements", plot.implements or ""),
            ("fits when", to_text(plot.when) if plot.when is not None else ""),
            *((name, to_text(term)) for name, term in plot.scores().items()),
            ("listens to", _events(plot.receives)),
            ("outcomes", _events(plot.emits)),
            ("outputs", _declaration_text(plot.outputs)),
            ("variables", _declaration_text(plot.variables)),
            *(_robot(plot.robot) if plot.robot is not None else ()),
        )
        if text
    ]


def _declaration_text(names: Mapping[str, PlotParameter | PlotVariable]) -> str:
    return ", ".join(f"{name}: {one.type}" for name, one in names.items())


def _robot(robot: RobotSection) -> Iterator[tuple[str, str]]:
    """Yield the interface of a robot section: the kinds of its parts and their texts."""
    yield "sensors", _declaration_text(robot.sensors)
    yield "motors", _declaration_text(robot.motors)
    yield "constants", ", ".join(f"{name} = {value_text(value)}" for name, value in robot.constants.items())
    for (group, *words), values in robot.assignments.items():
        yield (
            f"{_KINDS[group]} {' '.join(map(str, words))}",
            ", ".join(f"{motor} := {term_text(term)}" for motor, term in values.items()),
        )


_KINDS = {"operations": "operation", "activities": "activity"}


def _events(declared: Mapping[str, Mapping[str, str] | None]) -> str:
    return ", ".join(
        f"{name}({', '.join(attributes)})" if attributes else name for name, attributes in declared.items()
    )


def rule_text(rule: Rule) -> str:
    """Return a rule as one line of text."""
    response = rule.do
    steps = [content_text(response.use, response.arguments)] if response.use else []
    steps = [*(action_text(command) for command in response.command), *steps]
    steps += ["tell"] if response.tell is not None else []
    passed = f" with {', '.join(response.passed)}" if response.passed else ""
    limit = f" (at most {response.limit} times)" if response.limit else ""
    guard = f" [{to_text(rule.when)}]" if rule.when is not None else ""
    about = rule.on or f"{rule.place} {', '.join(rule.steps)}"
    of = f" of {', '.join(rule.of)}" if rule.of else ""
    steps.append(rule.then.replace("_", " "))
    return f"{about}{of} → {', '.join(steps)}{_other_outcomes(response)}{passed}{limit}{guard}"


def handler_text(handler: Handler) -> str:
    """Return a handler as one line of text."""
    do = handler.do
    steps = [action_text(command) for command in do.command]
    steps += [content_text(do.use, do.arguments)] if do.use else []
    steps += ["tell"] if do.tell is not None else []
    kind = "interrupted by" if handler.interrupt else "beside it"
    guard = f" [{to_text(handler.when)}]" if handler.when is not None else ""
    return f"{kind} {handler.on} → {', '.join(steps)}{_other_outcomes(do)}{guard}"


def _other_outcomes(do: Reaction) -> str:
    return "".join(f"; {outcome} → {then.replace('_', ' ')}" for outcome, then in do.on.items())
