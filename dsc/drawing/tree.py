"""Tree of a plot for the terminal: states with their kinds, actions and transitions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rich.text import Text
from rich.tree import Tree

from dsc.drawing.captions import (
    Labelled,
    block_texts,
    choice_text,
    content_text,
    facts,
    full_text,
    handler_text,
    labelled,
    labelled_by_value,
    rule_text,
    seconds_text,
    signature,
)
from dsc.model.plot import ActionPlot, initial_of
from dsc.model.states import (
    AnyState,
    CompositeState,
    DynamicState,
    FinalState,
    HistoryState,
    OrthogonalState,
    State,
    SubmachineState,
)
from dsc.model.transitions import Connector, SelectState
from knowledge_base.language.syntax.text import to_text

_SOFT, _RULE = "dim", "magenta"


def plot_tree(plot: ActionPlot) -> Tree:
    """Return the plot as a tree of text; a line that is too long for the terminal ends in an ellipsis."""
    tree = Tree(_line((signature(plot), "bold"), (plot.about or "", "italic dim")))
    for fact in facts(plot):
        tree.add(_line((fact, _SOFT)))
    _add_states(tree, plot.states, initial_of(plot))
    if plot.rules:
        rules = tree.add(_line(("rules", "bold")))
        for rule in plot.rules:
            rules.add(_line((rule_text(rule), _RULE)))
    if plot.handlers:
        handlers = tree.add(_line(("handlers", "bold")))
        for handler in plot.handlers:
            handlers.add(_line((handler_text(handler), _RULE)))
    return tree


def _add_states(tree: Tree, states: Mapping[str, AnyState], initial: str) -> None:
    for name, state in states.items():
        mark = "● " if name == initial else ""
        branch = tree.add(_line((mark + name, "bold"), (_kind(state), "cyan")))
        if isinstance(state, State):
            _add_content(branch, state)
        elif isinstance(state, Connector):
            _add_transitions(branch, labelled_by_value(state))


def _add_content(branch: Tree, state: State) -> None:
    if state.at_least is not None:
        branch.add(_line((f"at least {seconds_text(state.at_least)}", _SOFT)))
    for text in block_texts(state):
        branch.add(_line((text, _SOFT)))
    if isinstance(state, DynamicState) and state.goal is not None:
        branch.add(_line((f"goal {to_text(state.goal)}", _SOFT)))
    _add_transitions(branch, labelled(state), unnamed="always")
    if isinstance(state, CompositeState):
        _add_states(branch, state.states, initial_of(state))
    if isinstance(state, OrthogonalState):
        for name, region in state.regions.items():
            _add_states(branch.add(_line((f"region {name}", "italic"))), region.states, initial_of(region))
        _add_states(branch, state.connectors, initial="")


def _add_transitions(branch: Tree, transitions: Iterable[Labelled], *, unnamed: str = "") -> None:
    for one in transitions:
        style = _RULE if one.transition.rule is not None else ""
        arrow = f" → {', '.join(one.transition.targets)}" if one.transition.targets else ""
        led = f"{one.trigger or unnamed}{arrow}".strip()
        branch.add(_line((led, style), (full_text(one, trigger=False), _SOFT)))


def _kind(state: AnyState) -> str:  # noqa: PLR0911  # a table by kind
    match state:
        case FinalState(emit=event):
            return "final" + (f" ^{event}" if event is not None else "")
        case HistoryState(history=depth, target=target):
            return f"{depth} history → {target}"
        case SelectState(select=value):
            return f"select {to_text(value)}"
        case Connector():
            return "choice"
        case SubmachineState():
            return f"use {content_text(state.use, state.arguments)}"
        case DynamicState():
            content = f"offers {state.offer}" if state.offer is not None else f"[{', '.join(state.candidates)}]"
            return f"dynamic {content}{choice_text(state)}"
        case CompositeState() | OrthogonalState():
            return type(state).__name__.removesuffix("State").lower()
        case _:
            return ""


def _line(*parts: tuple[str, str]) -> Text:
    """Return one line of styled parts with two spaces between them; the terminal's edge truncates the line."""
    line = Text(no_wrap=True, overflow="ellipsis")
    for text, style in parts:
        if text:
            line.append(("  " if line else "") + text, style)
    return line
