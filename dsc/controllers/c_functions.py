"""C functions of a controller for its guards, blocks of actions, times, parameters and initial values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from dsc.controllers.expression_text import SUFFIX, ExpressionText
from dsc.controllers.identifiers import by_name
from dsc.controllers.model import (
    Action,
    Arguments,
    Assign,
    Branch,
    Command,
    Condition,
    Controller,
    Fire,
    Fixed,
    Group,
    Kind,
    Read,
    Start,
    Value,
    attributes_read,
    may_fail,
)
from dsc.controllers.runtime.tables import SHORTEST_PERIOD
from dsc.controllers.runtime.values import INT64_MIN

TYPES: Mapping[Kind, str] = {"integer": "int64_t", "number": "double", "boolean": "bool"}
"""Types in C, by kind of data."""
_SMALL = 2**31


def constant_text(value: Fixed) -> str:
    """Return a constant in C."""
    if isinstance(value.value, bool):
        return "true" if value.value else "false"
    if isinstance(value.value, int):
        if value.value == INT64_MIN:
            return "INT64_MIN"
        return str(value.value) if abs(value.value) < _SMALL else f"INT64_C({value.value})"
    return repr(value.value)


class _CExpressions(ExpressionText):
    words = ("&", "|", "!")  # compilers warn of contradictions between operands of `&&`, which charts may have

    def __init__(self, data: Mapping[str, str], attributes: Mapping[str, str]) -> None:
        self._data, self._attributes = data, attributes

    def constant(self, value: Fixed) -> str:
        return constant_text(value)

    def read(self, value: Read) -> str:
        if value.source == "data":
            return f"c->data.{self._data[value.name]}"
        return f"c->event.{self._attributes[value.name]}"

    def active(self, node: int) -> str:
        return f"c->active[{node}]"

    def call(self, function: str, args: list[str]) -> str:
        return f"chart_{function}({', '.join(args)})"

    def lift(self, text: str, _kind: Kind) -> str:
        return text if _kind == "boolean" else f"chart_{SUFFIX[_kind]}({text})"


class CFunctions:
    """Writer of the functions of one controller."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._data = by_name(controller.data)
        self._attributes = by_name(controller.attributes)
        self._arguments = by_name(controller.arguments)
        self._parameters = by_name(controller.parameters)
        self._text = _CExpressions(self._data, self._attributes)

    def lines(self) -> Iterator[str]:
        """Yield the lines of all functions."""
        yield from self._guards()
        yield from self._blocks()
        yield from self._seconds()
        yield from self._fits()
        yield from self._fill()

    # -- conditions and times ----------------------------------------------------------------------------

    def _guards(self) -> Iterator[str]:
        yield from ("static int chart_guard(struct chart *c, int guard)", "{", "    (void)c;", "    switch (guard) {")
        for number, (about, condition) in [*enumerate(self._controller.guards)][1:]:
            yield f"    case {number}: /* {_comment(about)} */"
            yield from self._absent(condition, "return CHART_ERROR;")
            yield f"        return {self._text.condition(condition)};"
        yield from ("    default:", "        return 1;", "    }", "}", "")

    def _seconds(self) -> Iterator[str]:
        yield from ("static struct chart_num chart_seconds(const struct chart *c, int timer)", "{", "    (void)c;")
        yield "    switch (timer) {"
        for number, timer in enumerate(self._controller.timers):
            yield f"    case {number}: /* {timer.kind} of {_comment(self._controller.nodes[timer.node].name)} */"
            yield from self._absent(timer.seconds, "return chart_no_num(CHART_ERROR);")
            text = self._text.value(timer.seconds)
            seconds = text if may_fail(timer.seconds) else f"chart_num({text})"
            yield f"        return chart_lasting({seconds}, {SHORTEST_PERIOD if timer.kind == 'every' else 0.0});"
        yield from ("    default:", "        return chart_no_num(CHART_ERROR);", "    }", "}", "")

    def _absent(self, e: Value | Condition, then: str) -> Iterator[str]:
        present = self._present([e])
        if present:
            yield from (f"        if (!({present})) {{", f"            {then}", "        }")

    def _present(self, values: Iterable[Value | Condition]) -> str:
        names = dict.fromkeys(name for value in values for name in attributes_read(value))
        return " && ".join(f"c->event.has_{self._attributes[name]}" for name in names)

    # -- data --------------------------------------------------------------------------------------------

    def _fits(self) -> Iterator[str]:
        numbers = [self._attributes[name] for name, kind in self._controller.attributes.items() if kind == "number"]
        yield from ("static bool chart_fits(const struct chart_attributes *data)", "{", "    (void)data;")
        for word in numbers:
            yield f"    if (data->has_{word} && !(data->{word} >= -DBL_MAX && data->{word} <= DBL_MAX)) {{"
            yield from ("        return false;", "    }")
        yield from ("    return true;", "}", "")

    def _fill(self) -> Iterator[str]:
        one = self._controller
        given = [_start_value(parameter.default, self._text) for parameter in one.parameters.values()]
        yield f"const struct chart_parameters chart_defaults = {{{', '.join(given) or '0'}}};"
        yield ""
        yield "static int chart_fill(struct chart *c, const struct chart_parameters *parameters)"
        yield from ("{", "    int bad = 0;")
        required = any(parameter.default is None for parameter in one.parameters.values())
        yield from ("    if (!parameters) {",)
        yield "        return CHART_ERROR;" if required else "        parameters = &chart_defaults;"
        yield from ("    }", "    (void)c;")
        for name, parameter in one.parameters.items():
            own = f"c->data.{self._data[name]}"
            yield f"    {own} = parameters->{self._parameters[name]};"
            conditions = [self._text.condition(condition) for condition in parameter.conditions]
            if parameter.kind == "number":
                conditions.insert(0, f"({own} >= -DBL_MAX && {own} <= DBL_MAX)")
            for text in conditions:
                yield from (f"    if ({text} != 1) {{", "        return CHART_ERROR;", "    }")
        for name, value in one.initial:
            yield f"    c->data.{self._data[name]} = {self._take(value)};"
            if may_fail(value):
                yield from ("    if (bad) {", "        return bad;", "    }")
        yield from ("    return bad;", "}", "")

    def _take(self, value: Value) -> str:
        text = self._text.value(value)
        return f"chart_take_{SUFFIX[value.kind]}({text}, &bad)" if may_fail(value) else text

    # -- actions -----------------------------------------------------------------------------------------

    def _blocks(self) -> Iterator[str]:
        yield from ("static void chart_block(struct chart *c, int block)", "{", "    (void)c;", "    switch (block) {")
        for number, block in [*enumerate(self._controller.blocks)][1:]:
            yield f"    case {number}: /* {_comment(block.about)} */"
            yield from self._actions(block.actions, "        ")
            yield "        break;"
        yield from ("    default:", "        break;", "    }", "}", "")

    def _actions(self, actions: Iterable[Action], indent: str) -> Iterator[str]:
        for action in actions:
            match action:
                case Assign(values):
                    yield from self._act(values, indent, [f"c->data.{self._data[name]}" for name, _ in values])
                case Fire(event, values, outcome):
                    function = "chart_emit" if outcome else "chart_fire_event"
                    yield from self._call(values, indent, f"{function}(c, {event}, &given);", "attributes")
                case Start(activity, values):
                    yield from self._call(values, indent, f"chart_start(c, {activity}, &given);", "arguments")
                case Command(command, values):
                    yield from self._call(values, indent, f"chart_command(c, {command}, &given);", "arguments")
                case Group(block):
                    yield f"{indent}chart_block(c, {block});"
                case Branch(condition, then, otherwise):
                    yield from self._branch(condition, then, otherwise, indent)

    def _call(self, values: Arguments, indent: str, call: str, struct: str) -> Iterator[str]:
        names = self._attributes if struct == "attributes" else self._arguments
        fields = [f"given.{names[name]}" for name, _ in values]
        has = [f"given.has_{names[name]} = true;" for name, _ in values]
        yield f"{indent}{{"
        yield f"{indent}    struct chart_{struct} given;"
        yield f"{indent}    memset(&given, 0, sizeof given);"
        yield from self._act(values, f"{indent}    ", fields, [*has, call])
        yield f"{indent}}}"

    def _act(self, values: Arguments, indent: str, targets: list[str], then: Iterable[str] = ()) -> Iterator[str]:
        """Yield the computation of values, then their assignment, and what follows unless a value has failed."""
        plain = [value for _, value in values]
        present = self._present(plain)
        may_end = bool(present) or any(map(may_fail, plain))
        yield f"{indent}{{"
        if may_end:
            yield f"{indent}    int bad = {f'{present} ? 0 : CHART_ERROR' if present else 0};"
        for number, value in enumerate(plain):
            yield f"{indent}    const {TYPES[value.kind]} a{number} = {self._take(value)};"
        inner = f"{indent}    "
        if may_end:
            yield from (f"{inner}if (bad) {{", f"{inner}    chart_fail(c, bad);")
            if self._controller.scxml:
                yield f"{inner}    return;"
            yield f"{inner}}} else {{"
            inner += "    "
        yield from [f"{inner}{target} = a{number};" for number, target in enumerate(targets)]
        yield from [f"{inner}{line}" for line in then]
        if may_end:
            yield f"{indent}    }}"
        yield f"{indent}}}"

    def _branch(
        self, condition: Condition, then: tuple[Action, ...], otherwise: tuple[Action, ...], indent: str
    ) -> Iterator[str]:
        present, text = self._present([condition]), self._text.condition(condition)
        yield f"{indent}{{"
        yield f"{indent}    const int chosen = {f'!({present}) ? CHART_ERROR : ' if present else ''}{text};"
        yield from (f"{indent}    if (chosen < 0) {{", f"{indent}        chart_fail(c, chosen);", f"{indent}    }}")
        yield f"{indent}    if (chosen == 1) {{"
        yield from self._actions(then, f"{indent}        ")
        yield f"{indent}    }} else {{"
        yield from self._actions(otherwise, f"{indent}        ")
        yield from (f"{indent}    }}", f"{indent}}}")


def _start_value(default: Fixed | None, text: _CExpressions) -> str:
    return "0" if default is None else text.constant(default)


def _comment(text: str) -> str:
    return text.replace("*/", "* /").replace("/*", "/ *")
