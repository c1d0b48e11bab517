"""Substitution of a plot by another one with an interface that fits all its holders (S0.1)."""

from __future__ import annotations

from collections.abc import Iterable

from dsc.model.plot import ActionPlot
from knowledge_base.errors import InputError, SchemaError

_ROLE = ("when", "implements", "effects", "confirm")
"""The properties by which a library knows a plot; a substitute without them takes those of the original."""


def stand_in(original: ActionPlot, substitute: ActionPlot) -> ActionPlot:
    """Return the substitute under the original's name, with the original's role if it declares none.

    The role is the condition as a candidate, and the planning action with the treatment of its effects. The result
    declares every outcome of the original, so that the holders' transitions remain valid.

    Raises:
        SchemaError: a holder of the original could not hold the substitute.
    """
    require_stand_in(original, substitute)
    role = {key: getattr(original, key) for key in _ROLE if key not in substitute.model_fields_set}
    emits = {**original.emits, **substitute.emits}
    return substitute.model_copy(update={"name": original.name, "emits": emits, **role})


def require_stand_in(original: ActionPlot, substitute: ActionPlot) -> None:
    """Raise an error if a holder of the original could not hold the substitute.

    Holders pass all parameters of the original, or only the required ones, and wire its outcomes.

    Raises:
        SchemaError: the interfaces differ; the message names the difference.
    """
    for name, parameter in original.parameters.items():
        own = substitute.parameters.get(name)
        if own is None:
            raise _refusal(original, substitute, f"lacks its parameter '{name}'", name, substitute.parameters)
        if own.type != parameter.type:
            different = f"takes '{name}' as '{own.type}', not as '{parameter.type}'"
            raise _refusal(original, substitute, different, own.type, (parameter.type,))
    for name, parameter in substitute.parameters.items():
        given = name in original.parameters and original.parameters[name].default is None
        if parameter.default is None and not given:
            needs = f"needs the parameter '{name}', which holders need not give"
            raise _refusal(original, substitute, needs, name, original.parameters)
    for name, output in original.outputs.items():
        if name not in substitute.outputs or substitute.outputs[name].type != output.type:
            lacking = f"does not return '{name}' as '{output.type}'"
            raise _refusal(original, substitute, lacking, name, substitute.outputs)
    for event, attributes in substitute.emits.items():
        if event not in original.emits:
            new = f"emits '{event}', which no holder has wired"
            raise _refusal(original, substitute, new, event, original.emits)
        for name in original.emits[event] or ():
            if name not in (attributes or {}):
                lacking = f"emits '{event}' without its attribute '{name}'"
                raise _refusal(original, substitute, lacking, name, attributes or ())


def _refusal(original: ActionPlot, substitute: ActionPlot, why: str, found: str, valid: Iterable[str]) -> InputError:
    message = f"'{substitute.name}' cannot replace '{original.name}': it {why}"
    return SchemaError(message, place=substitute.place(("plot",)), found=found, valid=valid)
