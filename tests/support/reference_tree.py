"""What the reference interpreter walks on: a plot laid out as a tree of nodes, and what conditions and terms mean there.

One tree for everything that runs: the nodes of a plot hang below the state that holds it. Nothing here is shared with
`dsc.engine`; a chart is read from the values of `dsc.model` alone.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass, field
from typing import Any

from dsc.model.plot import ActionPlot, initial_of
from dsc.model.states import CompositeState, FinalState, HistoryState, OrthogonalState, State
from dsc.model.transitions import ChoiceState, SelectState
from knowledge_base.language.syntax import effect as eff
from knowledge_base.language.syntax import expression as lang

COMPARE = {
    "=": operator.eq, "!=": operator.ne, "<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge,
}  # fmt: skip


class NoValueError(Exception):
    """A variable without value."""


@dataclass(eq=False)
class Instance:
    """One running plot: its variables, what its histories remember, the state that holds it."""

    plot: ActionPlot
    host: Node | None
    variables: dict[str, Any] = field(default_factory=dict)
    remembered: dict[str, Any] = field(default_factory=dict)
    nodes: dict[str, Any] = field(default_factory=dict)

    @property
    def scxml(self):
        return self.plot.dialect == "scxml"


@dataclass(eq=False)
class Node:
    """A state, a region (no model value of its own to show), or a plot.

    Attributes:
        kind: `plot`, `region`, or `state`, which connectors and histories are as well.
        kids: what is directly inside, in document order; histories stand apart.
        position: its place in document order through all plots; comparable.
        visit: which entry into it this is; an event for an earlier one is dropped.
    """

    kind: str
    name: str
    model: Any
    instance: Instance
    parent: Node | None
    position: tuple[Any, ...]
    kids: list[Node] = field(default_factory=list)
    histories: list[Node] = field(default_factory=list)
    first: str = ""
    visit: object = None

    def ancestors(self):
        node = self.parent
        while node is not None:
            yield node
            node = node.parent

    def inside(self, other):
        return other in self.ancestors()

    @property
    def parallel(self):
        return isinstance(self.model, OrthogonalState)

    @property
    def compound(self):
        return self.kind != "state" or isinstance(self.model, CompositeState)

    @property
    def final(self):
        return isinstance(self.model, FinalState)

    @property
    def history(self):
        return isinstance(self.model, HistoryState)

    @property
    def connector(self):
        return isinstance(self.model, ChoiceState | SelectState)

    @property
    def scope(self):
        """Whether transitions can be at home here (findLCCA).

        A region that was made only to hold one state, which it is named after, is none in dialect `scxml`.
        """
        alone = self.kind == "region" and self.instance.scxml and [*self.model.states] == [self.name]
        return self.compound and not alone

    @property
    def path(self):
        """The names of the states on the way, through all plots."""
        host = self.instance.host
        return f"{host.path}/{self.name}" if host else self.name

    def placed(self, key):
        """Its transitions under a key such as `on`, as (path, label, transition)."""
        if not isinstance(self.model, State) and not self.connector:
            return []
        always = ("choice", "cases", "else") if self.connector else ("always",)
        keys = always if key == "always" else (key,)
        return [found for found in self.model.placed_transitions() if found[0][0] in keys]


def grow(plot, host=None):
    """The tree of a plot that begins to run, below the state that holds it."""
    instance = Instance(plot, host)
    position = (*host.position, 0) if host else ()
    root = Node("plot", "", plot, instance, host, position)
    _grow_states(root, plot)
    return root


def _grow_states(parent, scope):
    parent.first = initial_of(scope)
    for name, state in scope.states.items():
        node = _append("state", parent, name, state)
        if isinstance(state, CompositeState):
            _grow_states(node, state)
        elif isinstance(state, OrthogonalState):
            for region_name, region in state.regions.items():
                _grow_states(_append("region", node, region_name, region), region)
            for history_name, history in state.connectors.items():
                _append("state", node, history_name, history)


def _append(kind, parent, name, model):
    place = len(parent.kids) + len(parent.histories)
    node = Node(kind, name, model, parent.instance, parent, (*parent.position, place))
    (parent.histories if node.history else parent.kids).append(node)
    if kind == "state":
        parent.instance.nodes[name] = node
    return node


def holds(condition, bindings, facts, active):
    """Whether a condition is true, given values, facts, and which states of the plot are active."""
    match condition:
        case lang.Atom("in-state", (lang.Constant(name),)):
            return active(name)
        case lang.Atom(predicate, args):
            return (predicate, *(value(a, bindings) for a in args)) in facts
        case lang.Not(body):
            return not holds(body, bindings, facts, active)
        case lang.And(parts):
            return all(holds(part, bindings, facts, active) for part in parts)
        case lang.Or(parts):
            return any(holds(part, bindings, facts, active) for part in parts)
        case lang.Comparison(sign, left, right):
            return COMPARE[sign](value(left, bindings), value(right, bindings))
    raise NotImplementedError(condition)


def value(term, bindings):
    """What a term stands for; raises `NoValueError`."""
    match term:
        case lang.Constant(constant):
            return constant
        case lang.Variable(name):
            if name not in bindings:
                raise NoValueError(name)
            return bindings[name]
        case lang.Arithmetic("+", args):
            return sum(value(a, bindings) for a in args)
    raise NotImplementedError(term)


def told(effect):
    """The changes that an effect makes, in order: (fact, whether it is added)."""
    match effect:
        case eff.Add(lang.Atom(predicate, ())):
            return [((predicate,), True)]
        case eff.Delete(lang.Atom(predicate, ())):
            return [((predicate,), False)]
        case eff.AllOf(parts):
            return [change for part in parts for change in told(part)]
    raise NotImplementedError(effect)
