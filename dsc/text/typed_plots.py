"""Typed Python functions for plots, from their parameters and outputs (S2.11).

A function takes the parameters of its plot and returns a `PlotCall`, whose run has typed outputs. Types of the domain
become `NewType`s, a subtype after its supertype.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from keyword import iskeyword

from dsc.annotations import domain_type, type_class
from dsc.data_types import ANY, DataType, data_type, names_in
from dsc.model.declarations import PlotParameter
from dsc.model.plot import ActionPlot
from knowledge_base.facts import GEOMETRY
from knowledge_base.language.checking.vocabulary import ROOT_TYPE
from knowledge_base.world.schema import Schema

_VALUES = {
    **dict.fromkeys(("text", "symbol", "condition", ROOT_TYPE), "str"),
    "number": "float", "integer": "int", "boolean": "bool", GEOMETRY: "list[float]",
    "plot": "dict[str, Any]", ANY: "Any",
}  # fmt: skip
_FROM_TYPING = ("Annotated", "Any", "Literal", "NewType", "NotRequired", "TypedDict")


def typed_plots(plots: Iterable[ActionPlot], schema: Schema | None = None) -> str:
    """Return the text of a Python module with a function for each plot that is not generated, in order of names.

    Args:
        plots: the plots; their names become names of functions.
        schema: the types of the domain; without a schema, no type is a subtype of another.
    """
    wanted = sorted((plot for plot in plots if not plot.generated), key=lambda plot: plot.name)
    records = {name: fields for plot in wanted for name, fields in plot.types.items()}
    texts = [one.type for plot in wanted for one in (*plot.parameters.values(), *plot.outputs.values())]
    texts += [text for fields in records.values() for text in fields.values()]
    named = {name for text in texts for name in names_in(data_type(text))} - records.keys()
    types = [type_definition(name, schema) for name in with_supertypes(named, schema)]
    parts = ["\n".join(types)] if types else []
    parts += [_typed_dict(type_class(name), f"The record `{name}`.", _fields(own)) for name, own in records.items()]
    parts += [part for plot in wanted for part in (_outputs(plot), _function(plot)) if part]
    used = [name for name in _FROM_TYPING if any(f"{name}" in one for one in parts)]
    head = '"""Typed calls of plots, made by `dsc plot types`."""\n\nfrom __future__ import annotations\n\n'
    imports = (f"from typing import {', '.join(used)}\n\n" if used else "") + "from dsc import PlotCall\n"
    return head + imports + ("\n" if types else "\n\n") + "\n\n\n".join(parts) + "\n"


def with_supertypes(named: Iterable[str], schema: Schema | None) -> list[str]:
    """Return the types of objects among names, with their supertypes, each after its supertype."""
    known = schema.types if schema is not None else {}
    found = {one for name in named for one in (name, *(schema.ancestors(name) if schema and name in known else ()))}
    depth = {name: len(schema.ancestors(name)) if schema and name in known else 0 for name in found}
    return sorted(found - _VALUES.keys(), key=lambda name: (depth[name], name))


def type_definition(name: str, schema: Schema | None) -> str:
    """Return the definition of the type of objects in Python."""
    made, parent = type_class(name), schema.types.get(name) if schema is not None else None
    above = _annotation(parent) if parent else "str"
    if domain_type(made) == name:
        return f'{made} = NewType("{made}", {above})'
    return f'{made} = Annotated[{above}, "{name}"]'


def annotation_of(kind: DataType, name: Callable[[DataType], str]) -> str:
    """Return a type of plots as a Python annotation; `name` returns that of a type without parts."""
    inner = "Any" if kind.inner is None else annotation_of(kind.inner, name)
    match kind.kind:
        case "list":
            return f"list[{inner}]"
        case "map":
            return f"dict[str, {inner}]"
        case "optional":
            return f"{inner} | None"
        case "choice":
            return f"Literal[{', '.join(map(repr, kind.values))}]".replace("'", '"')
        case _:
            return name(kind)


def _annotation(text: str) -> str:
    return annotation_of(data_type(text), _annotation_of_name)


def _annotation_of_name(kind: DataType) -> str:
    return _VALUES.get(kind.name or kind.kind) or type_class(kind.name)


def _fields(record: Mapping[str, str]) -> dict[str, str]:
    return {
        name: f"NotRequired[{_annotation(text)}]" if text.startswith("optional ") else _annotation(text)
        for name, text in record.items()
    }


def _value_annotation(parameter: PlotParameter) -> str:
    if parameter.among and parameter.type in {"text", "symbol"}:
        return f"Literal[{', '.join(map(repr, parameter.among))}]".replace("'", '"')
    return _annotation(parameter.type)


def _outputs(plot: ActionPlot) -> str:
    if not plot.outputs:
        return ""
    types = {name: _annotation(one.type) for name, one in plot.outputs.items()}
    return _typed_dict(_outputs_class(plot), f"Outputs of the plot `{plot.name}`.", types)


def _typed_dict(name: str, about: str, types: Mapping[str, str]) -> str:
    if all(map(is_python_name, types)):
        lines = [f"    {key}: {annotation}" for key, annotation in types.items()]
        return "\n".join([f"class {name}(TypedDict):", f'    """{about}"""', "", *lines])
    items = ", ".join(f'"{output}": {annotation}' for output, annotation in types.items())
    return f'{name} = TypedDict("{name}", {{{items}}})'


def _function(plot: ActionPlot) -> str:
    names = dict(_python_names(plot.parameters))
    returned = f"PlotCall[{_outputs_class(plot)}]" if plot.outputs else "PlotCall"
    taken = [_parameter_text(names[name], one) for name, one in plot.parameters.items()]
    lines = [f"def {_python_name(plot.name)}({'*, ' if taken else ''}{', '.join(taken)}) -> {returned}:"]
    if len(lines[0]) > 88:  # the width of formatters
        lines = [f"def {_python_name(plot.name)}(", "    *,", *(f"    {one}," for one in taken), f") -> {returned}:"]
    lines += _docstring(plot)
    given = ", ".join(f'"{name}": {names[name]}' for name in plot.parameters)
    return "\n".join([*lines, f'    return {returned}("{plot.name}", {{{given}}})'])


def _parameter_text(name: str, parameter: PlotParameter) -> str:
    annotation = _value_annotation(parameter)
    if parameter.required:
        return f"{name}: {annotation}"
    return f"{name}: {annotation.removesuffix(' | None')} | None = None"


def _docstring(plot: ActionPlot) -> Iterator[str]:
    about = (plot.about or f"Call the plot `{plot.name}`.").strip().replace("\\", "\\\\").replace('"""', "'''")
    yield f'    """{about.splitlines()[0]}'.rstrip() + ('"""' if "\n" not in about else "")
    yield from (f"    {line}".rstrip() for line in about.splitlines()[1:])
    if "\n" in about:
        yield '    """'


def _outputs_class(plot: ActionPlot) -> str:
    return type_class(_python_name(plot.name).replace("_", "-")) + "Outputs"


def _python_names(parameters: Mapping[str, PlotParameter]) -> Iterator[tuple[str, str]]:
    yield from ((name, _python_name(name)) for name in parameters)


def _python_name(name: str) -> str:
    made = "".join(one if one.isalnum() or one == "_" else "_" for one in name)
    return made if is_python_name(made) else f"{made}_"


def is_python_name(name: str) -> bool:
    """Return whether a name is one of Python, too."""
    return name.isidentifier() and not iskeyword(name)
