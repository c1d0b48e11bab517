"""Writer of action plots as SCXML; it refuses skills, knowledge, dynamic states and timeouts."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from xml.etree import ElementTree as ET

from dsc.engine.membership import asked_states
from dsc.errors import NotExpressibleError
from dsc.model.actions import (
    Assign,
    Block,
    Choose,
    Emit,
    ExternalAction,
    Internal,
    Log,
    Withdraw,
)
from dsc.model.plot import ActionPlot, Scope, initial_of
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    FinalState,
    HistoryState,
    OrthogonalState,
    Region,
    State,
    SubmachineState,
)
from dsc.model.transitions import Connector, Transition
from dsc.scxml.document import NAMESPACE
from dsc.scxml.value_kinds import NO_VALUE
from dsc.text.text_diagrams import require_targets
from knowledge_base.language.syntax.expression import (
    ARITHMETIC,
    And,
    Arithmetic,
    Atom,
    Comparison,
    Constant,
    Expression,
    Imply,
    Not,
    Or,
    Term,
    Variable,
    free_variables,
)
from knowledge_base.language.syntax.text import to_text

_SIGNS = {"=": "===", "!=": "!=="}


def expression_text(e: Expression) -> str:
    """Return the text of a `cond` attribute for a condition.

    Raises:
        NotExpressibleError: the condition reads the knowledge base, or has a quantifier.
    """
    match e:
        case And(parts):
            return " && ".join(map(_bracket, parts)) or "true"
        case Or(parts):
            return " || ".join(map(_bracket, parts)) or "false"
        case Not(body):
            return f"!({expression_text(body)})"
        case Imply(premise, conclusion):
            return f"!({expression_text(premise)}) || {_bracket(conclusion)}"
        case Comparison(sign, left, right):
            return f"{term_text(left)} {_SIGNS.get(sign, sign)} {term_text(right)}"
        case Atom() if asked := asked_states(e):
            return f"In({json.dumps(asked[0], ensure_ascii=False)})"
        case _:
            raise NotExpressibleError("condition", f"SCXML has no knowledge base to ask {to_text(e)}", place=e.place)


def term_text(term: Term) -> str:
    """Return a term's `expr` text; raise `NotExpressibleError` for a fluent or a name that is not an identifier."""
    match term:
        case Constant(NO_VALUE.value):
            return "undefined"
        case Constant(value):
            return json.dumps(value, ensure_ascii=False)
        case Variable(name):
            return f"_event.data.{identifier(name[6:])}" if name.startswith("event.") else identifier(name)
        case Arithmetic("-", (inner,)):
            return f"-({term_text(inner)})"
        case Arithmetic(sign, args) if sign in ARITHMETIC:
            return "(" + f" {sign} ".join(map(term_text, args)) + ")"
        case _:
            raise NotExpressibleError("term", f"SCXML has no fluent such as {to_text(term)}", place=term.place)


def identifier(name: str) -> str:
    """Return a variable's name; raise `NotExpressibleError` if the name is not an identifier in ECMAScript."""
    if not name.isidentifier():
        raise NotExpressibleError("variable", f"'{name}' is not an identifier in SCXML")
    return name


def _bracket(e: Expression) -> str:
    text = expression_text(e)
    return text if isinstance(e, Atom | Comparison | Not) else f"({text})"


def to_scxml(plot: ActionPlot) -> str:
    """Return the plot as an SCXML document; `parse_scxml` returns an equivalent plot for this document.

    Raises:
        NotExpressibleError: a part of the plot has no counterpart in SCXML.
        UnknownNameError: a transition refers to a missing state.
    """
    require_targets(plot)
    for what, there in (("parameters", plot.parameters), ("outputs", plot.outputs), ("rules", plot.rules),
                        ("handlers", plot.handlers), ("robot section", plot.robot),
                        ("outcome events", plot.emits), ("condition", plot.when), ("choice", plot.scores()),
                        ("planning action", plot.implements)):  # fmt: skip
        if there:
            raise NotExpressibleError(what, "SCXML has no counterpart", place=plot.place(()))
    root = ET.Element("scxml", {"xmlns": NAMESPACE, "version": "1.0", "name": plot.name, "datamodel": "ecmascript"})
    if plot.variables:
        data = ET.SubElement(root, "datamodel")
        for name, variable in plot.variables.items():
            value = None if variable.initial is None else term_text(variable.initial)
            initial = {} if value in {None, term_text(NO_VALUE)} else {"expr": value}
            ET.SubElement(data, "data", {"id": identifier(name), **initial})
    _Writer(plot).scope(root, plot)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


class _Writer:
    def __init__(self, plot: ActionPlot) -> None:
        self._plot = plot

    def scope(self, around: ET.Element, scope: Scope) -> None:
        around.set("initial", initial_of(scope))
        self._states(around, scope.states)

    def _states(self, around: ET.Element, states: Mapping[str, AnyState]) -> None:
        for name, state in states.items():
            self._state(around, name, state)

    def _state(self, around: ET.Element, name: str, state: AnyState) -> None:
        if any(blank in name for blank in " \t\n"):
            raise NotExpressibleError("state", f"the name '{name}' has a blank")
        if isinstance(state, HistoryState):
            self._history(around, name, state)
        elif isinstance(state, FinalState) and state.emit is not None:
            raise NotExpressibleError("outcome event", f"'{name}' fires one")
        elif isinstance(state, FinalState):
            final = ET.SubElement(around, "final", {"id": name})
            self._block(final, "onentry", state.entry)
        elif isinstance(state, Connector):
            passage = ET.SubElement(around, "state", {"id": name})
            for _, transition in state.transitions():
                self._transition(passage, name, None, transition)
        else:
            self._proper(around, name, state)

    def _history(self, around: ET.Element, name: str, state: HistoryState) -> None:
        history = ET.SubElement(around, "history", {"id": name, "type": state.history})
        default = ET.SubElement(history, "transition", {"target": state.target})
        _actions(default, state.do)

    def _proper(self, around: ET.Element, name: str, state: State) -> None:
        if isinstance(state, SubmachineState | DynamicState):
            raise NotExpressibleError("submachine or dynamic state", f"'{name}' is filled by other plots")
        if type(state) is State and "done" in state.on and self._plot.dialect == "dsc":
            raise NotExpressibleError("completion", f"'{name}' has no content and is done immediately")
        for what, there in (("timeout", state.after), ("every", state.every), ("at_least", state.at_least)):
            if there:
                raise NotExpressibleError(what, f"'{name}' has one; SCXML sends delayed events instead")
        if state.on_break:
            raise NotExpressibleError("on_break", f"'{name}' has one; SCXML leaves a state always in the same way")
        element = ET.SubElement(around, "parallel" if isinstance(state, OrthogonalState) else "state", {"id": name})
        self._block(element, "onentry", state.entry)
        self._block(element, "onexit", state.exit)
        for event, transitions in state.on.items():
            for transition in transitions:
                self._transition(element, name, self._event(name, event), transition)
        for transition in state.always:
            self._transition(element, name, None, transition)
        if isinstance(state, CompositeState):
            self.scope(element, state)
        elif isinstance(state, OrthogonalState):
            self._states(element, state.connectors)
            for key, region in state.regions.items():
                self._region(element, key, region)

    def _event(self, name: str, event: str) -> str:
        return f"done.state.{name}" if event == "done" and self._plot.dialect == "dsc" else event

    def _region(self, around: ET.Element, key: str, region: Region) -> None:
        if list(region.states) == [key] and self._plot.dialect == "scxml":
            self._states(around, region.states)
            return
        if any(name == key for name, _, _ in self._plot.walk()):
            raise NotExpressibleError("region", f"'{key}' is also the name of a state")
        self.scope(ET.SubElement(around, "state", {"id": key}), region)

    def _transition(self, around: ET.Element, source: str, event: str | None, transition: Transition) -> None:
        element = ET.SubElement(around, "transition")
        if event is not None:
            element.set("event", event)
        if transition.guard is not None:
            element.set("cond", expression_text(transition.guard))
        if transition.targets:
            element.set("target", " ".join(transition.targets))
        if transition.internal:
            element.set("type", "internal")
        for what, there in (("pass", transition.passed), ("clear", transition.clear)):
            if there:
                raise NotExpressibleError(what, f"a transition of '{source}' has it, and SCXML no counterpart")
        if transition.rule is not None:
            raise NotExpressibleError("rule", f"'{source}' is answered by one")
        _actions(element, transition.effect)

    def _block(self, around: ET.Element, tag: str, actions: Iterable[ExternalAction | Internal]) -> None:
        """Add an element for each block of actions; actions without blocks share one element.

        Raises:
            NotExpressibleError: some actions are inside blocks and some outside.
        """
        listed = tuple(actions)
        blocks: list[tuple[ExternalAction | Internal, ...]] = [one.block for one in listed if isinstance(one, Block)]
        if blocks and len(blocks) < len(listed):
            raise NotExpressibleError("block", f"an error in the other actions would not end <{tag}>")
        for block in blocks or [listed] * bool(listed):
            _actions(ET.SubElement(around, tag), block)


def _actions(around: ET.Element, actions: Iterable[ExternalAction | Internal]) -> None:
    for action in actions:
        match action:
            case Assign(assign=terms):
                for number, (name, term) in enumerate(terms.items()):
                    if free_variables(term) & set(list(terms)[:number]):
                        raise NotExpressibleError("assign", f"the value of '{name}' reads what is assigned with it")
                    ET.SubElement(around, "assign", {"location": identifier(name), "expr": term_text(term)})
            case Log(log=parts, label=label):
                labelled = {"label": label} if label else {}
                shown = {"expr": _concatenate(parts)} if parts else {}
                ET.SubElement(around, "log", {**labelled, **shown})
            case Emit():
                _send(around, action)
            case Withdraw(withdraw=sent):
                which = {"sendid": sent.value} if isinstance(sent, Constant) else {"sendidexpr": term_text(sent)}
                ET.SubElement(around, "cancel", {name: str(value) for name, value in which.items()})
            case Choose():
                _if(around, action)
            case Block():
                raise NotExpressibleError("block", "only <onentry> and <onexit> are blocks")
            case _:
                raise NotExpressibleError(type(action).__name__.lower(), "SCXML knows no skills and no knowledge base")


def _concatenate(parts: Sequence[Term]) -> str:
    """Return an expression that concatenates the parts; without a text among several parts, `+` would add numbers."""
    texts = list(map(term_text, parts))
    joins = len(parts) == 1 or any(isinstance(part, Constant) and isinstance(part.value, str) for part in parts)
    return " + ".join(texts if joins else ['""', *texts])


def _send(around: ET.Element, action: Emit) -> None:
    if action.delay is None and not action.arguments:
        ET.SubElement(around, "raise", {"event": action.emit})
        return
    element = ET.SubElement(around, "send", {"event": action.emit})
    if action.delay is None:
        element.set("target", "#_internal")
    elif action.delay != Constant(0):
        element.set("delay", f"{_seconds(action.delay):g}s")
    if action.into is not None:
        element.set("idlocation", identifier(action.into))
    if action.id is not None:
        if not isinstance(action.id, Constant):
            raise NotExpressibleError("send/@id", "a computed id has no counterpart")
        element.set("id", str(action.id.value))
    for name, term in action.arguments.items():
        ET.SubElement(element, "param", {"name": name, "expr": term_text(term)})


def _seconds(delay: Term) -> float:
    if isinstance(delay, Constant) and isinstance(delay.value, int | float):
        return float(delay.value)
    raise NotExpressibleError("delay", "only a number of seconds can be written")


def _if(around: ET.Element, action: Choose) -> None:
    element = ET.SubElement(around, "if", {"cond": expression_text(action.condition)})
    _actions(element, action.then)
    if action.otherwise:
        ET.SubElement(element, "else")
        _actions(element, action.otherwise)
