"""Header of a drawing with the plot's interface, and a note with rules that no edge shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dsc.drawing.captions import action_text, content_text
from dsc.drawing.layout import LINE_HEIGHT, Box, BoxKind, Text, TextStyle, pack, shorten, text_width
from dsc.model.plot import ActionPlot, PlotParameter, PlotVariable
from dsc.model.rules import Handler, Rule
from knowledge_base.language.syntax.text import to_text

SIDE = 16.0
LEAST_WIDTH = 340.0


@dataclass(frozen=True, slots=True)
class Header:
    """Texts at the top of a frame, their size, and the full form of shortened ones."""

    texts: tuple[Text, ...]
    width: float
    height: float
    title: str


def header(plot: ActionPlot, width: float) -> Header:
    """Return name, parameters, purpose and interface of a plot, for a frame of about that width."""
    room = max(width, LEAST_WIDTH)
    known = facts(plot)
    name = signature(plot)
    about = pack((plot.about or "").split(), TextStyle.ABOUT, room)
    lines = [(line, TextStyle.ABOUT) for line in about]
    lines += [(shorten(fact, TextStyle.DETAIL, room), TextStyle.DETAIL) for fact in known]
    texts = [Text(SIDE, 28.0, name, TextStyle.TITLE)]
    texts += [
        Text(SIDE, 31.0 + LINE_HEIGHT * number, line, style) for number, (line, style) in enumerate(lines, start=1)
    ]
    used = max(text_width(text.text, text.style) for text in texts)
    full = "\n".join(filter(None, [name, plot.about, *known]))
    return Header(tuple(texts), used + 2 * SIDE, 38.0 + LINE_HEIGHT * len(lines), full)


def signature(plot: ActionPlot) -> str:
    """Return the plot's name and parameters."""
    return f"{plot.name}({_declared(plot.parameters)})" if plot.parameters else plot.name


def facts(plot: ActionPlot) -> list[str]:
    """Return the rest of the interface, one fact a line."""
    return [
        f"{what}: {text}"
        for what, text in (
            ("implements", plot.implements or ""),
            ("fits when", to_text(plot.when) if plot.when is not None else ""),
            ("listens to", _events(plot.receives)),
            ("outcomes", _events(plot.emits)),
            ("outputs", _declared(plot.outputs)),
            ("variables", _declared(plot.variables)),
        )
        if text
    ]


def _declared(names: Mapping[str, PlotParameter | PlotVariable]) -> str:
    return ", ".join(f"{name}: {one.type}" for name, one in names.items())


def _events(declared: Mapping[str, Mapping[str, str] | None]) -> str:
    return ", ".join(
        f"{name}({', '.join(attributes)})" if attributes else name for name, attributes in declared.items()
    )


def rules_note(rows: Sequence[str], about: str) -> Box:
    """Return a box that lists rules and handlers without an edge."""
    texts = [Text(12.0, 20.0, about, TextStyle.ABOUT)]
    texts += [
        Text(12.0, 22.0 + LINE_HEIGHT * number, shorten(row, TextStyle.RULE, 480.0), TextStyle.RULE)
        for number, row in enumerate(rows, start=1)
    ]
    width = max(text_width(text.text, text.style) for text in texts) + 24
    height = 30.0 + LINE_HEIGHT * len(rows)
    return Box(BoxKind.NOTE, "", 0, 0, width, height, tuple(texts), title="\n".join(rows))


def rule_text(rule: Rule) -> str:
    """Return a rule on one line."""
    response = rule.do
    steps = [content_text(response.use, response.arguments)] if response.use else []
    steps = [*(action_text(command) for command in response.command), *steps]
    steps += ["tell"] if response.tell is not None else []
    passed = f" with {', '.join(response.passed)}" if response.passed else ""
    limit = f" (at most {response.limit} times)" if response.limit else ""
    guard = f" [{to_text(rule.when)}]" if rule.when is not None else ""
    about = rule.on or f"{rule.place} {', '.join(rule.steps)}"
    of = f" of {', '.join(rule.of)}" if rule.of else ""
    return f"{about}{of} → {', '.join([*steps, rule.then.replace('_', ' ')])}{passed}{limit}{guard}"


def handler_text(handler: Handler) -> str:
    """Return a handler on one line."""
    do = handler.do
    steps = [action_text(command) for command in do.command]
    steps += [content_text(do.use, do.arguments)] if do.use else []
    steps += ["tell"] if do.tell is not None else []
    kind = "interrupted by" if handler.interrupt else "beside it"
    guard = f" [{to_text(handler.when)}]" if handler.when is not None else ""
    return f"{kind} {handler.on} → {', '.join(steps)}{guard}"
