"""The written semantics (docs/semantics.md) as code: a naive interpreter of action plots, to judge the engine by.

It follows SCXML 1.0, appendix D, procedure by procedure, over one tree of nodes (`reference_tree`). It keeps no
tables, remembers nothing between two questions and shares nothing with `dsc.engine`. Skills, dynamic states and
what goes out besides `switch` actions are left out.

Where the page is silent, this is assumed:

- A transition without target leaves nothing, so it neither waits for `at_least` nor makes an exit the state's own.
- What is kept comes again for the state that kept it alone, before anything else. A period is not kept.
- An event is kept unless a transition that is taken would preempt the one that waits for it.
- `?event` stays the last event that came, taken or not; transitions without trigger read it too. A `done` that its
  state does not listen to does not come.
- Histories are forgotten between leaving and entering. A transition that forgets the very history that it leads to
  goes where that history leads at first, and its domain is worked out for that.
- `error` for a guard is fired once in a macrostep for each transition of a running plot; in dialect `scxml`, where it
  has a trigger, once for each event that is no error.
- A parallel whose children are all in final states is in a final state (SCXML 3.4), so that the parallel around it may
  be complete with it. (`enterStates` of appendix D, to the letter, looks no further than the grandparent.)
- An error that a plot in dialect `scxml` does not take is dropped, like other events.
- Nothing outside a transition's domain is entered, also if its history belongs to a state around that domain: such
  a state is active. (Appendix D, to the letter, would enter it once more.)
- A connector is a state that is entered and left; history can remember it when something else was faster.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from typing import Any

from reference_tree import Node, NoValueError, grow, holds, told, value

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
from dsc.model.states import State, SubmachineState

MOST_MICROSTEPS = 1000


class GoesRoundError(Exception):
    """The chart goes round in circles."""


@dataclass(frozen=True)
class Occurrence:
    """An event: for one entry (`visit`) into a node, or for one running plot, or for everybody."""

    name: str
    attributes: dict[str, Any] = field(default_factory=dict)
    to: Node | None = None
    visit: object = None
    exact: bool = False
    instance: object = None
    number: int | None = None


@dataclass(frozen=True)
class Way:
    """A transition of a node; which one, `place` says."""

    node: Node
    place: tuple[Any, ...]
    transition: object

    @property
    def key(self):
        return self.node, self.place


@dataclass
class Report:
    """What one macrostep did."""

    handled: bool = False
    microsteps: list[Any] = field(default_factory=list)
    modes: list[Any] = field(default_factory=list)
    emitted: list[Any] = field(default_factory=list)
    errors: int = 0
    told: dict[str, Any] = field(default_factory=dict)


class Reference:
    """One running chart in a world of plain facts."""

    def __init__(self, *plots, facts=()):
        self.plots = {plot.name: plot for plot in plots}
        self.outermost = plots[0]
        self.facts = set(facts)
        self.root = None
        self.active = set()
        self.waiting = set()
        self.kept = []
        self.ended = False

    # -- what a test does --------------------------------------------------------------------------------

    def start(self):
        self._begin()
        self.root = grow(self.outermost)
        self._initialise(self.root.instance, {})
        self._enter_all(self._entry_set_of(self.root))
        self._close_microstep()
        return self._run_to_completion()

    def send(self, name, attributes=None):
        return self.react(Occurrence(name, attributes or {}))

    def send_to(self, path, name, attributes=None):
        node = self.at(path)
        return self.react(Occurrence(name, attributes or {}, to=node, visit=node.visit))

    def time_passes(self, path, key, number=0):
        """A timeout (`after`), a period (`every`) or the least time (`at_least`) of an active state."""
        node = self.at(path)
        return self.react(Occurrence(key, to=node, visit=node.visit, exact=True, number=number))

    def react(self, event):
        self._begin()
        if self.root is None:
            return self.report
        self.report.handled = self._take(event)
        return self._run_to_completion()

    def at(self, path):
        return next(node for node in self.active if node.kind == "state" and node.path == path)

    @property
    def configuration(self):
        return [node.path for node in self._in_order(self.active) if node.kind == "state"]

    @property
    def variables(self):
        """Those of the outermost plot, while it runs."""
        return self.root and self.root.instance.variables

    # -- the macrostep: mainEventLoop --------------------------------------------------------------------

    def _begin(self):
        self.report = Report()
        self.exited, self.entered = [], []
        self.queue: deque[Occurrence] = deque()
        self.event = None
        self.turn = 0
        self.broken = set()

    def _run_to_completion(self):
        while not self.ended and self.root is not None:
            if self._take_ways(None):
                continue
            if not self.queue:
                return self.report
            event = self.queue.popleft()
            if not self._take(event):
                self.report.errors += event.name == "error"
        self._exit_all(set(self.active), own=set())
        self._close_microstep()
        self.root = None
        self.report.errors += sum(event.name == "error" for event in self.queue)
        return self.report

    def _take(self, event):
        self.event = event
        self.turn += event.name not in ("error", "error.execution")
        if event.to is not None and (event.to not in self.active or event.to.visit is not event.visit):
            return False
        if event.name == "at_least":
            self.waiting.discard(event.to)
            own = {"to": event.to, "visit": event.to.visit, "exact": True}
            self.queue.extend(replace(kept, **own) for node, kept in self.kept if node is event.to)
            self.kept = [one for one in self.kept if one[0] is not event.to]
            return True
        return self._take_ways(event)

    def _take_ways(self, event):
        enabled = self._select(event)
        late = [way for way in enabled if way.node in self.waiting and way.transition.targets]
        taken = self._without_conflicts([way for way in enabled if way not in late])
        keeping = {way.node: way for way in late if not any(self._preempts(other, way) for other in taken)}
        if event is None or event.name == "every":
            keeping = {}
        self.kept += [(node, event) for node in keeping]
        if taken:
            if len(self.report.microsteps) >= MOST_MICROSTEPS:
                raise GoesRoundError
            self._microstep(taken)
        return bool(taken or keeping)

    # -- which transitions: selectTransitions, removeConflictingTransitions ------------------------------

    def _select(self, event):
        found: dict[tuple[Node, tuple[Any, ...]], Way] = {}
        leaves = [node for node in self._in_order(self.active) if not any(kid in self.active for kid in node.kids)]
        for leaf in leaves:
            way = self._first_enabled(leaf, event)
            if way is not None:
                found.setdefault(way.key, way)
        return [*found.values()]

    def _first_enabled(self, leaf, event):
        for node in (leaf, *leaf.ancestors()):
            for way in self._listening(node, event):
                if self._passes(way):
                    return way
        return None

    def _listening(self, node, event):
        if event is None:
            return [Way(node, place, transition) for place, _, transition in node.placed("always")]
        if not self._sees(node, event):
            return []
        if event.number is not None:
            timed = [Way(node, place, transition) for place, _, transition in node.placed(event.name)]
            return [timed[event.number]]
        ways = [(Way(node, place, transition), label) for place, label, transition in node.placed("on")]
        return [way for way, label in ways if _matches(label, event.name, node.instance.scxml)]

    def _sees(self, node, event):
        if event.to is not None:
            around = event.to.inside(node) and node.instance is event.to.instance
            return node is event.to or (around and not event.exact)
        return event.instance in (None, node.instance)

    def _passes(self, way):
        if way.transition.guard is None:
            return True
        try:
            return self._holds(way.node.instance, way.transition.guard)
        except NoValueError:
            each = way.node.instance.scxml and way.place[0] == "on"
            broken = (*way.key, self.turn if each else 0)
            if broken not in self.broken:
                self.broken.add(broken)
                self._fail(way.node.instance)
            return False

    def _without_conflicts(self, enabled):
        filtered: list[Way] = []
        for way in enabled:
            rivals = [other for other in filtered if self._conflict(way, other)]
            if all(way.node.inside(other.node) for other in rivals):
                filtered = [other for other in filtered if other not in rivals]
                filtered.append(way)
        return filtered

    def _conflict(self, one, other):
        return bool(self._exit_set(one) & self._exit_set(other))

    def _preempts(self, one, other):
        return one.node.inside(other.node) and self._conflict(one, other)

    # -- what is left: computeExitSet, getTransitionDomain -----------------------------------------------

    def _exit_set(self, way):
        if not way.transition.targets:
            return set()
        domain = self._domain(way)
        return {node for node in self.active if node.inside(domain)}

    def _domain(self, way):
        targets = self._effective_targets(way)
        source = way.node
        if way.transition.internal and source.compound and self._stays_inside(way):
            return source
        scopes = (node for node in source.ancestors() if node.scope)
        return next(scope for scope in scopes if all(target.inside(scope) for target in targets))

    def _stays_inside(self, way):
        return all(target.inside(way.node) for target in self._effective_targets(way))

    def _effective_targets(self, way):
        forgotten = self._forgotten(way)
        return [real for target in self._targets(way) for real in self._stands_for(target, forgotten)]

    def _stands_for(self, target, forgotten):
        if not target.history:
            return [target]
        remembered = target.instance.remembered.get(target)
        if remembered is not None and target not in forgotten:
            return remembered
        return self._stands_for(target.instance.nodes[target.model.target], forgotten)

    def _targets(self, way):
        return [way.node.instance.nodes[name] for name in way.transition.targets]

    def _forgotten(self, way):
        found = []
        for name in way.transition.clear:
            holder = way.node.instance.nodes[name.removesuffix("*")]
            regions = [kid for kid in holder.kids if kid.kind == "region"]
            below = _descendants(holder) if name.endswith("*") else regions
            found += [history for node in (holder, *below) for history in node.histories]
        return found

    # -- the microstep: exitStates, executeTransitionContent, enterStates --------------------------------

    def _microstep(self, taken):
        leaving = {node for way in taken for node in self._exit_set(way)}
        self._exit_all(leaving, own=self._left_by_their_own(taken))
        passed = {}
        for way in taken:
            self._perform(way.node.instance, way.transition.effect)
            passed.update(self._passed(way))
        for way in taken:
            for history in self._forgotten(way):
                way.node.instance.remembered.pop(history, None)
        # No transition of a microstep enters what another one does: their domains are apart.
        self._enter_all(self._entry_set(taken), passed)
        self._close_microstep()

    def _left_by_their_own(self, taken):
        return {way.node for way in taken if way.node in self._exit_set(way)}

    def _passed(self, way):
        """What the transition passes to the plot of its target."""
        try:
            arguments = {name: self._value(way.node.instance, term) for name, term in way.transition.passed.items()}
        except NoValueError:
            self._fail(way.node.instance)
            return {}
        return {self._targets(way)[0]: arguments} if arguments else {}

    def _exit_all(self, leaving, own):
        for node in leaving:
            self._remember(node)
        for node in reversed(self._in_order(leaving)):
            if node.kind == "state":
                self.exited.append(node.path)
            if isinstance(node.model, State):
                is_broken = node not in own and node.model.on_break
                self._perform(node.instance, node.model.on_break if is_broken else node.model.exit)
            self.active.discard(node)
            self.waiting.discard(node)
            self.kept = [one for one in self.kept if one[0] is not node]
            if isinstance(node.model, SubmachineState):
                node.kids = []

    def _remember(self, node):
        for history in node.histories:
            inside = [other for other in self._in_order(self.active) if other.inside(node)]
            if history.model.history == "deep":
                # What runs inside a plot is not remembered: the state that holds it stands for it.
                own = [other for other in inside if other.instance is node.instance]
                kept = [one for one in own if not any(other.inside(one) for other in own)]
            else:
                kept = [other for other in inside if other.parent is node]
            node.instance.remembered[history] = kept

    def _enter_all(self, entering, passed=None):
        nodes, defaults = entering
        for node in self._in_order(nodes):
            self.active.add(node)
            node.visit = object()
            if node.kind == "state":
                self.entered.append(node.path)
            if getattr(node.model, "at_least", None) is not None:
                self.waiting.add(node)
            self._perform(node.instance, getattr(node.model, "entry", ()))
            self._perform(node.instance, defaults.get(node, ()))
            if isinstance(node.model, SubmachineState):
                self._fill(node, (passed or {}).get(node, {}))
            elif node.final:
                self._reach_end(node)
            elif type(node.model) is State and not node.instance.scxml:
                self._done(node)

    def _fill(self, host, passed):
        """The plot of a submachine state becomes part of the tree."""
        try:
            own = {name: term for name, term in host.model.arguments.items() if name not in passed}
            arguments = {name: self._value(host.instance, term) for name, term in own.items()}
        except NoValueError:
            self._fail(host.instance)
            return
        content = grow(self.plots[host.model.use], host)
        content.parent = host
        host.kids = [content]
        self._initialise(content.instance, {**arguments, **passed})
        self._enter_all(self._entry_set_of(content))

    def _initialise(self, instance, arguments):
        plot = instance.plot
        for name, parameter in plot.parameters.items():
            instance.variables[name] = arguments[name] if name in arguments else value(parameter.default, {})
        for name, variable in (*plot.variables.items(), *plot.outputs.items()):
            initial = variable.initial
            instance.variables[name] = None if initial is None else value(initial, instance.variables)

    def _close_microstep(self):
        self.report.microsteps.append((self.exited, self.entered))
        self.exited, self.entered = [], []

    # -- what is entered: computeEntrySet ----------------------------------------------------------------

    def _entry_set_of(self, plot):
        """A plot with its default content."""
        nodes: set[Node] = set()
        defaults: dict[Node, Any] = {}
        self._add_descendants(plot, nodes, defaults)
        return nodes, defaults

    def _entry_set(self, taken):
        entering: set[Node] = set()
        defaults: dict[Node, Any] = {}
        for way in taken:
            if way.transition.targets:
                nodes: set[Node] = set()
                domain = self._domain(way)
                for target in self._targets(way):
                    self._add_descendants(target, nodes, defaults)
                for target in self._effective_targets(way):
                    self._add_ancestors(target, domain, nodes, defaults)
                entering |= {node for node in nodes if node.inside(domain)}
        return entering, defaults

    def _add_descendants(self, node, nodes, defaults):
        if node.history:
            targets, around = node.instance.remembered.get(node), node.parent
            if targets is None:
                targets = [node.instance.nodes[node.model.target]]
                defaults[around] = node.model.do
        else:
            nodes.add(node)
            if node.parallel:
                self._add_regions(node, nodes, defaults)
            if not node.compound:
                return
            targets, around = [node.instance.nodes[node.first]], node
        for target in targets:
            self._add_descendants(target, nodes, defaults)
        for target in targets:
            self._add_ancestors(target, around, nodes, defaults)

    def _add_ancestors(self, node, around, nodes, defaults):
        for ancestor in node.ancestors():
            if ancestor is around:
                return
            nodes.add(ancestor)
            if ancestor.parallel:
                self._add_regions(ancestor, nodes, defaults)

    def _add_regions(self, node, nodes, defaults):
        for region in node.kids:
            if not any(other.inside(region) for other in nodes):
                self._add_descendants(region, nodes, defaults)

    # -- completion --------------------------------------------------------------------------------------

    def _reach_end(self, final):
        if final.model.emit:
            self._perform(final.instance, [Emit(emit=final.model.emit, arguments=final.model.arguments)])
        around = final.parent
        if around.kind == "plot":
            self._end_plot(around)
            return
        if around.kind == "state":
            self._done(around)
        region = self._region_ended_by(around)
        while region is not None and self._in_final_state(region.parent):
            self._done(region.parent)
            region = self._region_ended_by(region.parent)

    def _region_ended_by(self, around):
        """A region that was only made to hold a state has ended when the state has."""
        if around.kind == "region":
            return around
        return None if around.parent.kind != "region" or around.parent.scope else around.parent

    def _in_final_state(self, node):
        """isInFinalState."""
        if node.parallel:
            return all(map(self._in_final_state, node.kids))
        alone = node.kind == "region" and not node.scope
        ended = any(kid.final and kid in self.active for kid in node.kids)
        return ended or (alone and self._in_final_state(node.kids[0]))

    def _end_plot(self, plot):
        host = plot.instance.host
        if host is None:
            self.ended = True
        else:
            self._done(host, {name: plot.instance.variables[name] for name in plot.model.outputs})

    def _done(self, node, outputs=None):
        if node.instance.scxml:
            self.queue.append(Occurrence(f"done.state.{node.name}", outputs or {}, instance=node.instance))
        elif "done" in node.model.on:
            self.queue.append(Occurrence("done", outputs or {}, to=node, visit=node.visit, exact=True))

    # -- actions and conditions --------------------------------------------------------------------------

    def _perform(self, instance, actions):
        for action in actions:
            try:
                self._act(instance, action)
            except NoValueError:
                self._fail(instance)
                if instance.scxml:
                    return

    def _act(self, instance, action: ExternalAction | Internal):
        match action:
            case Switch(to=mode):
                self.report.modes.append(mode)
            case Assign(assign=terms):
                instance.variables.update({name: self._value(instance, term) for name, term in terms.items()})
            case Perform() | StartActivity() | StopActivity():
                self._move(instance, action)
            case Tell(tell=effect):
                for fact, is_added in told(effect):
                    (self.facts.add if is_added else self.facts.discard)(fact)
                    self.report.told[fact] = is_added
            case Emit(emit=name):
                self._emit(instance, name, {key: self._value(instance, t) for key, t in action.arguments.items()})
            case Choose():
                for inner in action.then if self._chooses(instance, action) else action.otherwise:
                    self._act(instance, inner)
            case Block(block=inside):
                self._perform(instance, inside)
            case Bind():
                raise NotImplementedError(action)
            case Trigger() | Configure() | Send() | Wire() | Unwire() | Withdraw() | Log():
                pass  # nothing of a chart without components depends on them

    def _move(self, instance, action):
        if isinstance(action, Perform) or instance.variables[action.change[0]] is not action.change[1]:
            self._act(instance, Assign(assign=instance.plot.motor_values(action)))

    def _chooses(self, instance, action):
        """A condition that cannot be evaluated is false, and an error (SCXML 5.9.1)."""
        try:
            return self._holds(instance, action.condition)
        except NoValueError:
            self._fail(instance)
            return False

    def _emit(self, instance, name, attributes):
        if name not in instance.plot.emits:
            self.queue.append(Occurrence(name, attributes, instance=instance))
        elif instance.host is None:
            self.report.emitted.append(name)
        elif instance.host in self.active:
            self.queue.append(Occurrence(name, attributes, to=instance.host, visit=instance.host.visit))

    def _fail(self, instance):
        self.queue.append(Occurrence("error.execution" if instance.scxml else "error", instance=instance))

    def _holds(self, instance, condition):
        nodes = instance.nodes
        return holds(condition, self._bindings(instance), self.facts, lambda name: nodes[name] in self.active)

    def _value(self, instance, term):
        return value(term, self._bindings(instance))

    def _bindings(self, instance):
        attributes = self.event.attributes if self.event else {}
        return {**instance.variables, **{f"event.{name}": given for name, given in attributes.items()}}

    @staticmethod
    def _in_order(nodes):
        return sorted(nodes, key=lambda node: node.position)


def _descendants(node):
    for kid in node.kids:
        yield kid
        yield from _descendants(kid)


def _matches(label, event, scxml):
    """Whether a transition's events are met: a prefix of the event's tokens does in SCXML (3.12.1)."""
    if not scxml:
        return label == event
    tokens = event.split(".")
    for one in label.split():
        wanted = [token for token in one.split(".") if token not in ("*", "")]
        if tokens[: len(wanted)] == wanted:
            return True
    return False
