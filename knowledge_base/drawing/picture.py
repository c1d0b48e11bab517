"""The content of a picture, without positions: objects, their facts, and the arrows between them."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from knowledge_base.errors import UnknownNameError
from knowledge_base.facts import Content, Fact
from knowledge_base.spelling import value_text
from knowledge_base.view import View

MOST_LINES = 12
"""Maximum number of lines on a card."""


@dataclass(frozen=True, slots=True)
class Label:
    """The text of a fact or fluent without its objects, and the kind of its arc."""

    text: str
    kind: str = ""


@dataclass(frozen=True, slots=True)
class Card:
    """An object, or a fact about several objects.

    Attributes:
        key: the identity of the card in arrows.
        title: the object's name, or the fact's predicate.
        kind: the object's type; empty for a fact.
        lines: facts and values about this object alone.
        middle: whether the card is the centre of the picture.
        of: the kind of a fact's arcs; empty for an object.
    """

    key: str
    title: str
    kind: str
    lines: tuple[Label, ...] = ()
    middle: bool = False
    of: str = ""


@dataclass(frozen=True, slots=True)
class Arrow:
    """An arrow between two cards, with the labels of its facts."""

    source: str
    target: str
    labels: tuple[Label, ...]


@dataclass(frozen=True, slots=True)
class Picture:
    """Cards and arrows; `omitted` is the number of omitted objects."""

    cards: tuple[Card, ...]
    links: tuple[Arrow, ...]
    omitted: int = 0


@dataclass(frozen=True, slots=True)
class _Said:
    """A fact or fluent: its objects in order, and its label."""

    things: tuple[str, ...]
    label: Label


def picture_of(world: View, thing: str | None, hops: int, most: int) -> Picture:
    """Return the picture of a world, or of an object's neighbourhood.

    The picture contains at most `most` objects, the nearest first.

    Raises:
        UnknownNameError: the object is unknown.
    """
    types = world.nodes()
    kinds = world.schema.kinds
    said = [_describe(fact, types, kinds) for fact in world.facts()]
    said += [_describe(fluent, types, kinds, f"= {_content(content)}") for fluent, content in world.values().items()]
    if thing is None:
        wanted = list(types)
    elif thing in types:
        wanted = list(_around(thing, said, hops))
    else:
        raise UnknownNameError(f"there is no object '{thing}'", found=thing, valid=types)
    shown = dict.fromkeys(wanted[:most])
    inside = [one for one in said if one.things and all(name in shown for name in one.things)]
    own = {name: [one for one in inside if set(one.things) == {name}] for name in shown}
    cards = [Card(name, name, types[name], tuple(_lines(own[name])), name == thing) for name in shown]
    links, relations = _links(one for one in inside if len(set(one.things)) > 1)
    return Picture((*cards, *relations), links, len(wanted) - len(shown))


def _describe(fact: Fact, types: Mapping[str, str], kinds: Mapping[str, str], value: str = "") -> _Said:
    things = tuple(arg for arg in fact.args if isinstance(arg, str) and arg in types)
    rest = [value_text(arg) for arg in fact.args if not (isinstance(arg, str) and arg in types)]
    text = " ".join(filter(None, (fact.predicate, *rest, value)))
    return _Said(things, Label(text, kinds.get(fact.predicate, "")))


def _content(content: Content) -> str:
    return f"{content:g}" if isinstance(content, float) else value_text(content, quoted=isinstance(content, str))


def _around(thing: str, said: Iterable[_Said], hops: int) -> Iterator[str]:
    """Yield the objects that are at most `hops` facts away, the nearest first."""
    adjacent: dict[str, dict[str, None]] = {}
    for one in said:
        for name in one.things:
            adjacent.setdefault(name, {}).update(dict.fromkeys(one.things))
    distance, waiting = {thing: 0}, deque([thing])
    while waiting:
        here = waiting.popleft()
        yield here
        if distance[here] < hops:
            fresh = [name for name in adjacent.get(here, ()) if name not in distance]
            distance.update(dict.fromkeys(fresh, distance[here] + 1))
            waiting.extend(fresh)


def _lines(said: list[_Said]) -> Iterator[Label]:
    for one in said[:MOST_LINES]:
        yield one.label
    if len(said) > MOST_LINES:
        yield Label(f"and {len(said) - MOST_LINES} more")


def _links(said: Iterable[_Said]) -> tuple[tuple[Arrow, ...], list[Card]]:
    """Return facts about two objects as arrows, one for each ordered pair, and all other facts as cards."""
    labels: dict[tuple[str, str], list[Label]] = {}
    links: list[Arrow] = []
    relations: list[Card] = []
    for one in said:
        if len(one.things) == 2:
            labels.setdefault((one.things[0], one.things[1]), []).append(one.label)
            continue
        key = f"fact {len(relations)}"  # with a blank, which no object's name contains
        relations.append(Card(key, one.label.text, "", of=one.label.kind))
        links += [Arrow(key, name, (Label(str(number)),)) for number, name in enumerate(one.things, 1)]
    joined = [Arrow(source, target, tuple(label)) for (source, target), label in labels.items()]
    return (*joined, *links), relations
