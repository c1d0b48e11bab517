"""Cards: boxes of one state, a plot's header or a list of rules; the texts determine the size of a card."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, replace

from dsc.drawing.captions import (
    action_text,
    block_texts,
    captions,
    choice_text,
    content_text,
    facts,
    labelled,
    seconds_text,
    signature,
)
from dsc.drawing.layout import LINE_HEIGHT, Box, BoxKind, Text, TextStyle, column, pack, shorten, text_width
from dsc.dynamic.library import Library
from dsc.dynamic.steps import candidates_of
from dsc.model.plot import ActionPlot
from dsc.model.states import DynamicState, FinalState, HistoryState, State, SubmachineState
from dsc.model.transitions import Connector, SelectState
from knowledge_base.language.syntax.expression import Term
from knowledge_base.language.syntax.text import to_text

DETAIL_WIDTH = 260.0
SIDE = 12.0
"""Free space left and right of texts, in pixels."""
NAME_HEIGHT = 30.0
MARK = 24.0
"""Width next to the name for the mark of submachine and dynamic states, in pixels."""
LEAST_WIDTH = 76.0
FINAL_SIZE = 20.0
DIAMOND_HEIGHT = 44.0
"""Height of a diamond with one line of text, in pixels."""
DOT_SIZE = 14.0
HEADER_SIDE = 16.0
HEADER_WIDTH = 340.0
"""Least width for the lines of a header, in pixels."""
CIRCLE_SIZE = 24.0


@dataclass(frozen=True, slots=True)
class CardRow:
    """A line of text in a box, and the full text of this line for the tooltip."""

    text: str
    style: TextStyle = TextStyle.DETAIL
    full: str = ""


def _column(rows: Iterable[CardRow | Text], x: float, y: float, *, centred: bool = False) -> tuple[Text, ...]:
    return column(((row.text, row.style) for row in rows), x, y, centred=centred)


def header(plot: ActionPlot, width: float) -> Box:
    """Return the top of a plot's frame with name, parameters, purpose and interface; `width` is approximate."""
    room = max(width, HEADER_WIDTH)
    known, name = facts(plot), signature(plot)
    lines = [(line, TextStyle.ABOUT) for line in pack((plot.about or "").split(), TextStyle.ABOUT, room)]
    lines += [(shorten(fact, TextStyle.DETAIL, room), TextStyle.DETAIL) for fact in known]
    texts = (Text(HEADER_SIDE, 28.0, name, TextStyle.TITLE), *column(lines, HEADER_SIDE, 46.0))
    used = max(text_width(text.text, text.style) for text in texts) + 2 * HEADER_SIDE
    kind = BoxKind.GENERATED if plot.generated else BoxKind.PLOT
    title = "\n".join(filter(None, [name, plot.about, *known]))
    return Box(kind, plot.name, 0, 0, used, 38.0 + LINE_HEIGHT * len(lines), texts, title=title)


def rules_note(rows: Sequence[str], about: str) -> Box:
    """Return a box that lists the rules and handlers that the drawing does not show as edges."""
    listed = column([(shorten(row, TextStyle.RULE, 480.0), TextStyle.RULE) for row in rows], 12.0, 37.0)
    texts = (Text(12.0, 20.0, about, TextStyle.ABOUT), *listed)
    width = max(text_width(text.text, text.style) for text in texts) + 24
    height = 30.0 + LINE_HEIGHT * len(rows)
    return Box(BoxKind.NOTE, "", 0, 0, width, height, texts, title="\n".join(rows))


def dot() -> Box:
    """Return the box of the initial pseudostate."""
    return Box(BoxKind.INITIAL, "", 0, 0, DOT_SIZE, DOT_SIZE)


def card(
    kind: BoxKind, name: str, rows: Sequence[CardRow], *, about: str = "", rule: bool = False, mark: bool = False
) -> Box:
    """Return the box of a state with its name and rows of text."""
    title_room = text_width(name, TextStyle.NAME) + 2 * SIDE + 2 * MARK * mark
    width = max(LEAST_WIDTH, title_room, *(text_width(row.text, row.style) + 2 * SIDE for row in rows))
    texts = (Text(width / 2, 20.0, name, TextStyle.NAME, centred=True), *_column(rows, SIDE, 47.0))
    height = NAME_HEIGHT + (LINE_HEIGHT * len(rows) + 9 if rows else 2)
    title = "\n".join(filter(None, [name, about, *(row.full for row in rows)]))
    lines = (NAME_HEIGHT,) if rows else ()
    return Box(kind, name, 0, 0, width, height, texts, lines, title, rule)


def final_card(name: str, state: FinalState) -> Box:
    """Return the box of a final state: the bullseye, with name and outcome event below it."""
    rows = [(name, TextStyle.NAME)]
    if state.emit is not None:
        rows.append((f"^{state.emit}", TextStyle.DETAIL))
    width = max(FINAL_SIZE, *(text_width(*row) for row in rows))
    texts = column(rows, width / 2, FINAL_SIZE + LINE_HEIGHT, centred=True)
    fired = f"^{content_text(state.emit, state.arguments)}" if state.emit is not None else ""
    title = "\n".join(filter(None, [name, state.about, fired]))
    eye = Box(BoxKind.BULLSEYE, "", (width - FINAL_SIZE) / 2, 0, FINAL_SIZE, FINAL_SIZE)
    height = FINAL_SIZE + 4 + LINE_HEIGHT * len(rows)
    return Box(BoxKind.FINAL, name, 0, 0, width, height, texts, title=title, boxes=(eye,))


def history_card(name: str, state: HistoryState) -> Box:
    """Return the box of a history: a circle with H or H*, as in UML, next to the name and default actions."""
    done = "; ".join(map(action_text, state.do))
    rows = [CardRow(name, TextStyle.NAME, name), *([_row(f"/ {done}")] if done else [])]
    aside = CIRCLE_SIZE / 2 + 7
    half = aside + max(text_width(row.text, row.style) for row in rows)
    height = max(CIRCLE_SIZE, LINE_HEIGHT * len(rows))
    top = (height - LINE_HEIGHT * len(rows)) / 2 + 11.5
    texts = _column(rows, half + aside, top)
    mark = "H*" if state.history == "deep" else "H"
    letter = Text(CIRCLE_SIZE / 2, CIRCLE_SIZE / 2 + 4, mark, TextStyle.DETAIL, centred=True)
    circle = Box(BoxKind.CIRCLE, "", 0, 0, CIRCLE_SIZE, CIRCLE_SIZE, (letter,))
    title = "\n".join(filter(None, [name, state.about, *(row.full for row in rows[1:])]))
    # The circle is in the middle of the box, because edges end there.
    circle = circle.moved(half - CIRCLE_SIZE / 2, (height - CIRCLE_SIZE) / 2)
    return Box(BoxKind.HISTORY, name, 0, 0, 2 * half, height, texts, title=title, boxes=(circle,))


def name_below(history: Box) -> Box:
    """Return a history's box with its texts below the circle, for edges that arrive from the left."""
    width = max(CIRCLE_SIZE, *(text_width(text.text, text.style) for text in history.texts))
    below = LINE_HEIGHT * len(history.texts)
    texts = _column(history.texts, width / 2, below + CIRCLE_SIZE + 12, centred=True)
    (circle,) = history.boxes
    circle = circle.moved((width - CIRCLE_SIZE) / 2 - circle.x, below - circle.y)
    return replace(history, width=width, height=CIRCLE_SIZE + 2 * below, texts=texts, boxes=(circle,))


def diamond(name: str, connector: Connector) -> Box:
    """Return the box of a `choice` or `select` connector: a flat diamond around the name and the selected term."""
    rows = [CardRow(name, TextStyle.NAME, name)]
    if isinstance(connector, SelectState):
        rows.append(_row(to_text(connector.select)))
    block = LINE_HEIGHT * len(rows)
    height = DIAMOND_HEIGHT + 2 * LINE_HEIGHT * (len(rows) - 1)
    # A text fits if text width / diamond width + text height / diamond height is at most 1.
    width = (max(text_width(row.text, row.style) for row in rows) + SIDE) / (1 - block / height)
    first = (height - block) / 2 + 11.5
    texts = _column(rows, width / 2, first, centred=True)
    title = "\n".join(filter(None, [name, connector.about, *(row.full for row in rows[1:])]))
    return Box(BoxKind.CHOICE, name, 0, 0, width, height, texts, title=title)


def name_next_to(final: Box) -> Box:
    """Return a final state's box with its texts right of the bullseye, for edges that arrive from the left."""
    height = max(FINAL_SIZE, LINE_HEIGHT * len(final.texts))
    top = (height - LINE_HEIGHT * len(final.texts)) / 2
    texts = _column(final.texts, FINAL_SIZE + 7, top + 12)
    eye = replace(final.boxes[0], x=0.0, y=(height - FINAL_SIZE) / 2)
    width = FINAL_SIZE + 7 + max(text_width(text.text, text.style) for text in texts)
    return replace(final, width=width, height=height, texts=texts, boxes=(eye,))


def leaf_card(
    name: str, state: State, library: Library | None, *, rule: bool, told: bool, emits: Container[str]
) -> Box:
    """Return the box of a state without inner states: simple, submachine or dynamic.

    Args:
        name: name of the state.
        state: the state.
        library: provider of the plots that the state uses, for details of their interface; may be `None`.
        rule: whether a rule added the state.
        told: whether the box contains the state's purpose; otherwise only the tooltip does.
        emits: the outcomes of the plot, see `block_texts`.
    """
    rows = [_row(state.about, TextStyle.ABOUT)] if told and state.about and not rule else []
    kind, about = BoxKind.SIMPLE, [state.about or ""]
    if isinstance(state, SubmachineState):
        kind = BoxKind.SUBMACHINE
        rows.append(_row(content_text(state.use, state.arguments)))
        about.append(_about(state.use, library))
    elif isinstance(state, DynamicState):
        kind = BoxKind.DYNAMIC
        rows += _choices(state, library)
    rows += action_rows(state, emits)
    mark = kind is not BoxKind.SIMPLE
    return card(kind, name, rows, about="\n".join(filter(None, about)), rule=rule, mark=mark)


def action_rows(state: State, emits: Container[str]) -> list[CardRow]:
    """Return rows with a state's least duration, its actions, and its reactions that do not exit the state.

    `emits` contains the outcomes of the plot, see `block_texts`.
    """
    rows = [] if state.at_least is None else [_row(f"≥ {seconds_text(state.at_least)}")]
    rows += [_row(text) for text in block_texts(state, emits)]
    for caption in captions(one for one in labelled(state) if one.transition.target is None):
        rows += [CardRow(line, caption.style, caption.full) for line in caption.lines[:1]]
        rows += [CardRow(line, caption.style) for line in caption.lines[1:]]
    return rows


def _choices(state: DynamicState, library: Library | None) -> list[CardRow]:
    rows = []
    if state.offer is not None:
        rows.append(_row(f"plots that offer {state.offer}{choice_text(state)}"))
    offering = [] if library is None else [one.name for one in candidates_of(state, library)]
    for name in state.candidates or offering:
        plot = _find_plot(name, library)
        condition = f" [{to_text(plot.when)}]" if plot is not None and plot.when is not None else ""
        term = None if plot is None else plot.scores().get(state.choose)
        score = "" if term is None else f"{choice_text(state)} {to_text(term)}"
        rows.append(_row(f"◇ {content_text(name, _select_arguments(state, plot))}{condition}{score}"))
    if state.situation:
        rows.append(_row(f"situation: {', '.join(map(to_text, state.situation))}"))
    if state.goal is not None:
        rows.append(_row(f"plan for {to_text(state.goal)}"))
    return rows


def _select_arguments(state: DynamicState, plot: ActionPlot | None) -> dict[str, Term]:
    """Return the state's arguments that are parameters of a candidate; all arguments for an unknown candidate."""
    return {k: v for k, v in state.arguments.items() if plot is None or k in plot.parameters}


def _find_plot(name: str, library: Library | None) -> ActionPlot | None:
    return library.plot(name) if library is not None and name in library else None


def _about(name: str, library: Library | None) -> str:
    plot = _find_plot(name, library)
    return plot.about or "" if plot is not None else ""


def _row(text: str, style: TextStyle = TextStyle.DETAIL) -> CardRow:
    return CardRow(shorten(text, style, DETAIL_WIDTH), style, text)
