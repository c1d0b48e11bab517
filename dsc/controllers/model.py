"""Model of a controller: the tables of one plot, with typed expressions and actions; both targets are made of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Kind = Literal["integer", "number", "boolean"]
"""Kinds of data: an integer of 64 bits, a double, or a truth value."""
Source = Literal["data", "event"]


@dataclass(frozen=True, slots=True)
class Fixed:
    """A constant; as a condition it is a truth value."""

    value: int | float | bool
    kind: Kind


@dataclass(frozen=True, slots=True)
class Read:
    """The value of a variable of the plot, or of an attribute of the current event."""

    source: Source
    name: str
    kind: Kind


@dataclass(frozen=True, slots=True)
class Operation:
    """A computation that may fail; `function` is one of the functions of `runtime.values`."""

    function: str
    args: tuple[Value, ...]
    kind: Kind


Value = Fixed | Read | Operation


@dataclass(frozen=True, slots=True)
class Comparison:
    """A comparison of two values of one kind; `relation` is `eq`, `lt` or `le`."""

    relation: Literal["eq", "lt", "le"]
    left: Value
    right: Value


@dataclass(frozen=True, slots=True)
class Combination:
    """A condition that is true if `every` part is, or else if any part is."""

    every: bool
    parts: tuple[Condition, ...]


@dataclass(frozen=True, slots=True)
class Opposite:
    """A condition that is true if its body is false."""

    body: Condition


@dataclass(frozen=True, slots=True)
class Active:
    """A condition that is true if a node is active."""

    node: int


Condition = Fixed | Comparison | Combination | Opposite | Active
Arguments = tuple[tuple[str, Value], ...]
"""Values by name."""


@dataclass(frozen=True, slots=True)
class Assign:
    """Assign values to variables, all of them or, after a failure, none."""

    values: Arguments


@dataclass(frozen=True, slots=True)
class Fire:
    """Fire an event in the chart or, as an `outcome`, to the host."""

    event: int
    values: Arguments
    outcome: bool


@dataclass(frozen=True, slots=True)
class Start:
    """Start an activity."""

    activity: int
    values: Arguments


@dataclass(frozen=True, slots=True)
class Command:
    """Send a command to the host."""

    command: int
    values: Arguments


@dataclass(frozen=True, slots=True)
class Branch:
    """Execute one of two sequences of actions."""

    condition: Condition
    then: tuple[Action, ...]
    otherwise: tuple[Action, ...]


@dataclass(frozen=True, slots=True)
class Group:
    """Execute another block of actions, which ends at its own failure."""

    block: int


Action = Assign | Fire | Start | Command | Branch | Group


@dataclass(frozen=True, slots=True)
class Block:
    """A sequence of actions; `about` names its place in the plot."""

    about: str
    actions: tuple[Action, ...]


@dataclass(slots=True)
class Node:
    """A node of the tables, as in `runtime.tables`."""

    name: str
    fields: dict[str, int | bool]
    edges: tuple[tuple[int, int], ...] = ()
    timers: tuple[int, ...] = ()
    activities: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Edge:
    """A transition of the tables, as in `runtime.tables`."""

    about: str
    source: int
    targets: tuple[int, ...]
    guard: int
    effect: int
    internal: bool
    each: bool
    cleared: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Timer:
    """A timer with the seconds until it is due; `number` is its edge, or for `within` its activity."""

    kind: Literal["at_least", "after", "every", "within"]
    node: int
    number: int
    seconds: Value


@dataclass(frozen=True, slots=True)
class Activity:
    """A skill that a state starts; `timer` limits its time; -1 means no limit."""

    skill: str
    node: int
    timer: int


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of the plot: its kind, its default, and the conditions that its value fulfils."""

    kind: Kind
    default: Fixed | None
    conditions: tuple[Condition, ...]


@dataclass(frozen=True, slots=True)
class Device:
    """A sensor or motor with its range; `start` is the value of a motor after the end."""

    kind: Kind
    least: Fixed
    most: Fixed
    start: Fixed


@dataclass(slots=True)
class Controller:
    """A compiled plot.

    Attributes:
        name: name of the plot.
        scxml: whether the plot is in dialect `scxml`.
        nodes, edges, timers, activities: the tables; numbers are positions.
        blocks, guards: blocks of actions and conditions by number; 0 is the empty block, and the condition without one.
        events: names of events by number; those from `first_event` may be posted.
        error_events: numbers of the events of failed evaluations.
        timed_out: number of the event of an activity whose time has passed; 0 if no activity has a limit.
        commands: texts of the commands by number.
        parameters: the parameters of the plot.
        data: kinds of parameters, variables and outputs.
        sensors, motors: the devices of a plot with a robot section.
        cycle: number of the event `cycle`; 0 without a robot section.
        initial: values of variables and outputs at the start, computed in this order.
        attributes: kinds of the attributes of events.
        arguments: kinds of the arguments of activities and commands.
    """

    name: str
    scxml: bool
    first_event: int = 3
    timed_out: int = 0
    memories: int = 0
    nodes: list[Node] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)
    timers: list[Timer] = field(default_factory=list)
    activities: list[Activity] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=lambda: [Block("nothing", ())])
    guards: list[tuple[str, Condition]] = field(
        default_factory=lambda: [("no guard", Fixed(value=True, kind="boolean"))]
    )
    events: list[str] = field(default_factory=list)
    error_events: tuple[int, ...] = ()
    commands: list[str] = field(default_factory=list)
    parameters: dict[str, Parameter] = field(default_factory=dict)
    data: dict[str, Kind] = field(default_factory=dict)
    sensors: dict[str, Device] = field(default_factory=dict)
    motors: dict[str, Device] = field(default_factory=dict)
    cycle: int = 0
    initial: list[tuple[str, Value]] = field(default_factory=list)
    attributes: dict[str, Kind] = field(default_factory=dict)
    arguments: dict[str, Kind] = field(default_factory=dict)


def may_fail(e: Value | Condition) -> bool:
    """Return whether the computation of a value or condition may fail."""
    match e:
        case Operation():
            return True
        case Comparison(_, left, right):
            return may_fail(left) or may_fail(right)
        case Combination(_, parts):
            return any(map(may_fail, parts))
        case Opposite(body):
            return may_fail(body)
        case _:
            return False


def attributes_read(e: Value | Condition) -> tuple[str, ...]:
    """Return the attributes of the current event that a value or condition reads, each once."""
    match e:
        case Read("event", name):
            return (name,)
        case Operation(_, args):
            parts: tuple[Value | Condition, ...] = args
        case Comparison(_, left, right):
            parts = (left, right)
        case Combination(_, conditions):
            parts = conditions
        case Opposite(body):
            parts = (body,)
        case _:
            parts = ()
    return tuple(dict.fromkeys(name for part in parts for name in attributes_read(part)))
