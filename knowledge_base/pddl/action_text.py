"""The `:action` and `:durative-action` sections of a domain file as read, names not resolved yet."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from knowledge_base.errors import ParseError, Place, SchemaError
from knowledge_base.language.syntax.durative import Duration, DurativeParts
from knowledge_base.language.syntax.effect import NO_EFFECT, Effect
from knowledge_base.language.syntax.expression import TRUE, Expression, TypedVariable
from knowledge_base.language.syntax.sexpr import Group, Node, Word, parse_variables
from knowledge_base.language.syntax.text import parse_condition, parse_effect, to_text, variables_text
from knowledge_base.pddl.beyond import ACTION_PARTS, refuse_forms, refused
from knowledge_base.pddl.durative_text import read_duration, read_timed
from knowledge_base.pddl.sections import word

ACTION, DURATIVE_ACTION = ":action", ":durative-action"
_PARTS = {
    ACTION: (":parameters", ":precondition", ":effect"),
    DURATIVE_ACTION: (":parameters", ":duration", ":condition", ":effect"),
}
_COMPARED = (
    *("duration", "precondition", "condition over all", "condition at the end"),
    *("effect at the start", "effect"),
)


@dataclass(frozen=True, slots=True)
class ActionText:
    """A planning action as written; omitted parts are `()`, true, or no effect.

    A durative action has a `duration` and `timed` parts; its precondition and effect equal these if nothing else
    happens during the action (see `DurativeParts`).
    """

    name: str
    parameters: tuple[TypedVariable, ...]
    precondition: Expression
    effect: Effect
    place: Place | None = field(compare=False)
    duration: Duration | None = None
    timed: DurativeParts | None = None


def read_actions(sections: Iterable[tuple[str, Group]]) -> tuple[ActionText, ...]:
    """The actions among a domain's sections, in order.

    Raises:
        ParseError: the form of one is wrong.
        UnsupportedConstructError: one uses a construct that nothing here can plan with.
        SchemaError: two different actions have one name.
    """
    return united(_action(keyword, group) for keyword, group in sections if keyword in _PARTS)


def united(actions: Iterable[ActionText]) -> tuple[ActionText, ...]:
    """The actions, each once.

    Raises:
        SchemaError: two actions of one name differ; it has both places and says in what.
    """
    found: dict[str, ActionText] = {}
    for action in actions:
        first = found.setdefault(action.name, action)
        if first != action:
            raise SchemaError(
                f"the action '{action.name}' is defined differently before (at {first.place}), with "
                + _difference(first, action),
                place=action.place,
            )
    return tuple(found.values())


def _difference(first: ActionText, second: ActionText) -> str:
    """The first part in which two actions differ, in both versions."""
    for part, before, here in zip(("parameters", *_COMPARED), _written(first), _written(second), strict=True):
        if before != here:
            return f"the {part} {before} instead of {here}"
    return "other words"


def _written(action: ActionText) -> Iterator[str]:
    yield variables_text(action.parameters)
    duration, timed = action.duration, action.timed
    yield "none" if duration is None else f"from {to_text(duration.least)} to {to_text(duration.most)}"
    if timed is None:
        timed = DurativeParts(start=action.precondition, end_effect=action.effect)
    yield from map(to_text, (timed.start, timed.over_all, timed.end, timed.start_effect, timed.end_effect))


def _action(keyword: str, group: Group) -> ActionText:
    if len(group.items) < 2:
        raise ParseError(f"an action has a name: ({keyword} NAME ...)", place=group.place)
    name = word(group.items[1], "the action's name")
    if name.text.startswith(":"):
        raise ParseError(f"an action has a name: ({keyword} NAME ...)", place=name.place)
    parts = _action_parts(keyword, group.items[2:], name)
    parameters = parse_variables(parts[":parameters"]) if ":parameters" in parts else ()
    return (_durative if keyword == DURATIVE_ACTION else _instantaneous)(name, parameters, parts)


def _instantaneous(name: Word, parameters: tuple[TypedVariable, ...], parts: dict[str, Node]) -> ActionText:
    return ActionText(
        name=name.folded(),
        parameters=parameters,
        precondition=parse_condition(parts[":precondition"]) if ":precondition" in parts else TRUE,
        effect=parse_effect(parts[":effect"]) if ":effect" in parts else NO_EFFECT,
        place=name.place,
    )


def _durative(name: Word, parameters: tuple[TypedVariable, ...], parts: dict[str, Node]) -> ActionText:
    if ":duration" not in parts:
        raise ParseError(f"how long does '{name.text}' take? ':duration (= ?duration SECONDS)'", place=name.place)
    duration = read_duration(parts[":duration"])
    timed = read_timed(parts.get(":condition"), parts.get(":effect"), duration)
    return ActionText(name.folded(), parameters, timed.precondition, timed.effect, name.place, duration, timed)


def _action_parts(keyword: str, nodes: Sequence[Node], name: Word) -> dict[str, Node]:
    parts: dict[str, Node] = {}
    for position in range(0, len(nodes), 2):
        key = word(nodes[position], f"a keyword of the action '{name.text}'")
        part = key.folded()
        if part in ACTION_PARTS:
            raise refused(ACTION_PARTS[part], part, key.place)
        if part not in _PARTS[keyword]:
            what = "a durative action" if keyword == DURATIVE_ACTION else "an action"
            raise ParseError(f"{what} has no part '{key.text}'", place=key.place, found=key.text, valid=_PARTS[keyword])
        if part in parts:
            raise ParseError(f"a second '{part}' of the action '{name.text}'", place=key.place)
        if position + 1 == len(nodes):
            raise ParseError(f"'{part}' is followed by nothing", place=key.place)
        refuse_forms(nodes[position + 1])
        parts[part] = nodes[position + 1]
    return parts
