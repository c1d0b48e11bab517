"""Typed Python functions for plots, from their parameters and outputs (S2.11).

A function takes the parameters of its plot and returns a `PlotCall`, whose run has typed outputs. Types of the domain
become `NewType`s, a subtype after its supertype.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from keyword import iskeyword

from dsc.annotations import domain_type, type_class
from dsc.model.declarations import PlotParameter
from dsc.model.plot import ActionPlot
from knowledge_base.language.checking.vocabulary import ROOT_TYPE
from knowledge_base.world.schema import Schema

_VALUES = {
    **dict.fromkeys(("text", "symbol", "condition", ROOT_TYPE), "str"),
    "plot": "dict[str, Any]", ANY: "Any", "number": "float", "integer": "int", "boolean": "bool", "geometry": "list[float]",
}  # fmt: skip


def typed_plots(plots: Iterable[ActionPlot], schema: Schema | None = None) -> str:
    """Return the text of a Python module with a function for each plot that is not generated, in order of names.

    Args:
        plots: the plots; their names become names of functions.
        schema: the types of the domain; without a schema, no type is a subtype of another.
    """
    wanted = sorted((plot for plot in plots if not plot.generated), key=lambda plot: plot.name)
    named = {one.type for plot in wanted for one in (*plot.parameters.values(), *plot.outputs.values())}
    types = [_type_definition(name, schema) for name in _with_supertypes(named, schema)]
    parts = ["\n".join(types)] if types else []
    parts += [part for plot in wanted for part in (_outputs(plot), _function(plot)) if part]
    used = [name for name in ("Annotated", "Literal", "NewType", "TypedDict") if any(f"{name}" in one for one in parts)]
    head = '"""Typed calls of plots, made by `dsc plot types`."""\n\nfrom __future__ import annotations\n\n'
    imports = (f"from typing import {', '.join(used)}\n\n" if used else "") + "from dsc import PlotCall\n"
    return head + imports + ("\n" if types else "\n\n") + "\n\n\n".join(parts) + "\n"


def _with_supertypes(named: Iterable[str], schema: Schema | None) -> list[str]:
    """Return the types of objects among names, with their supertypes, each after its supertype."""
    known = schema.types if schema is not None else {}
    found = {one for name in named for one in (name, *(schema.ancestors(name) if schema and name in known else ()))}
    depth = {name: len(schema.ancestors(name)) if schema and name in known else 0 for name in found}
    return sorted(found - _VALUES.keys(), key=lambda name: (depth[name], name))


def _type_definition(name: str, schema: Schema | None) -> str:
    made, parent = type_class(name), schema.types.get(name) if schema is not None else None
    above = _annotation(parent) if parent else "str"
    if domain_type(made) == name:
        return f'{made} = NewType("{made}", {above})'
    return f'{made} = Annotated[{above}, "{name}"]'


def _annotation(type_name: str) -> str:
    return _VALUES.get(type_name) or type_class(type_name)


def _permitted(parameter: PlotParameter) -> str:
    if parameter.among and parameter.type in {"text", "symbol"}:
        return f"Literal[{', '.join(map(repr, parameter.among))}]".replace("'", '"')
    return _annotation(parameter.type)


def _outputs(plot: ActionPlot) -> str:
    if not plot.outputs:
        return ""
    name, types = _outputs_class(plot), {name: _annotation(one.type) for name, one in plot.outputs.items()}
    if all(map(_usable, types)):
        lines = [f"    {output}: {annotation}" for output, annotation in types.items()]
        return "\n".join([f"class {name}(TypedDict):", f'    """Outputs of the plot `{plot.name}`."""', "", *lines])
    items = ", ".join(f'"{output}": {annotation}' for output, annotation in types.items())
    return f'{name} = TypedDict("{name}", {{{items}}})'


def _function(plot: ActionPlot) -> str:
    names = dict(_python_names(plot.parameters))
    returned = f"PlotCall[{_outputs_class(plot)}]" if plot.outputs else "PlotCall"
    taken = [_taken(names[name], one) for name, one in plot.parameters.items()]
    lines = [f"def {_python_name(plot.name)}({'*, ' if taken else ''}{', '.join(taken)}) -> {returned}:"]
    if len(lines[0]) > 88:  # the width of formatters
        lines = [f"def {_python_name(plot.name)}(", "    *,", *(f"    {one}," for one in taken), f") -> {returned}:"]
    lines += _docstring(plot)
    given = ", ".join(f'"{name}": {names[name]}' for name in plot.parameters)
    return "\n".join([*lines, f'    return {returned}("{plot.name}", {{{given}}})'])


def _taken(name: str, parameter: PlotParameter) -> str:
    return f"{name}: {_permitted(parameter)}" + (" | None = None" if parameter.default is not None else "")


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
    return made if _usable(made) else f"{made}_"


def _usable(name: str) -> bool:
    return name.isidentifier() and not iskeyword(name)
