"""Executable content (SCXML 4) as internal actions, in the form in which plots are written."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from dsc.text.scxml.document import Element
from dsc.text.scxml.ecmascript import condition, joined, term
from dsc.text.scxml.errors import NotExpressibleError
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.expression import Constant, Term, Variable

Names = Mapping[str, str]
"""The chart's data by their own spelling -> the name of the plot's variable."""
Form = dict[str, Any]

_PROCESSORS = frozenset({"", "scxml", "http://www.w3.org/TR/scxml/#SCXMLEventProcessor"})
_DELAY = re.compile(r"(\d+\.?\d*|\.\d+)(ms|s)")


def actions(elements: Iterable[Element], names: Names) -> list[Form]:
    """The actions that the elements stand for, in order.

    Raises:
        NotExpressibleError: one of them has no counterpart.
        InputError: an attribute is missing or wrong.
    """
    return [_READERS[element.name](element, names) for element in elements]


def needed(element: Element, attribute: str) -> str:
    """An attribute that must be there; raises `InputError`."""
    if not element.attributes.get(attribute):
        raise InputError(f"<{element.name}> needs the attribute '{attribute}'", place=element.place)
    return element.attributes[attribute]


def only_one(element: Element, *attributes: str) -> None:
    """Raise `InputError` if two of the attributes are there, which exclude each other."""
    both = [name for name in attributes if name in element.attributes]
    if len(both) > 1:
        message = f"<{element.name}> has both '{both[0]}' and '{both[1]}'"
        raise InputError(message, place=element.place, found=both[1])


def variable(name: str, names: Names, element: Element) -> str:
    """The variable for a datum; raises `UnknownNameError`."""
    if name not in names:
        raise UnknownNameError(f"there is no data '{name}'", place=element.place, found=name, valid=names)
    return names[name]


def _raise(element: Element, _: Names) -> Form:
    return {"emit": needed(element, "event")}


def _assign(element: Element, names: Names) -> Form:
    text = element.attributes.get("expr") or element.text
    if not text:
        raise InputError("<assign> needs the attribute 'expr'", place=element.place)
    location = variable(needed(element, "location"), names, element)
    return {"assign": {location: term(text, names, element.place)}}


def _log(element: Element, names: Names) -> Form:
    text = element.attributes.get("expr", "")
    parts = joined(text, names, element.place) if text else []
    return {"log": tuple(parts), "label": element.attributes.get("label", "")}


def _if(element: Element, names: Names) -> Form:
    branches: list[tuple[Element, list[Element]]] = [(element, [])]
    for child in element.children:
        if child.name in {"elseif", "else"}:
            if branches[-1][0].name == "else":
                raise InputError(f"<{child.name}> comes after <else>", place=child.place)
            branches.append((child, []))
        else:
            branches[-1][1].append(child)
    form: list[Form] = []
    for head, inside in reversed(branches):
        done = actions(inside, names)
        if head.name == "else":
            form = done
        else:
            form = [{"if": condition(needed(head, "cond"), names, head.place), "then": done, "else": form}]
    return form[0]


def _send(element: Element, names: Names) -> Form:
    if element.attributes.get("type", "") not in _PROCESSORS:
        raise NotExpressibleError("send/@type", "only the SCXML event processor is there", place=element.place)
    target = element.attributes.get("target", "")
    if target not in {"", "#_internal"}:
        raise NotExpressibleError("send/@target", "events go to the chart itself only", place=element.place)
    form: Form = {"emit": _constant(element, "event", names), "with": _arguments(element, names)}
    if target:
        return form
    if "id" in element.attributes:
        form["id"] = Constant(element.attributes["id"], quoted=True)
    if "idlocation" in element.attributes:
        form["into"] = variable(element.attributes["idlocation"], names, element)
    return {**form, "delay": _delay(element, names)}


def _cancel(element: Element, names: Names) -> Form:
    if "sendidexpr" in element.attributes:
        return {"withdraw": term(element.attributes["sendidexpr"], names, element.place)}
    return {"withdraw": Constant(needed(element, "sendid"), quoted=True)}


def _constant(element: Element, attribute: str, names: Names) -> str:
    """An attribute, or a string in the expression attribute of that name."""
    if f"{attribute}expr" not in element.attributes:
        return needed(element, attribute)
    only_one(element, attribute, f"{attribute}expr")
    found = term(element.attributes[f"{attribute}expr"], names, element.place)
    if isinstance(found, Constant) and isinstance(found.value, str):
        return found.value
    raise NotExpressibleError(f"send/@{attribute}expr", "must be a string in quotes", place=element.place)


def _delay(element: Element, names: Names) -> float:
    if not {"delay", "delayexpr"} & element.attributes.keys():
        return 0
    text = _constant(element, "delay", names)
    match = _DELAY.fullmatch(text)
    if match is None:
        raise InputError(f"'{text}' is no delay such as 10ms or 1.5s", place=element.place, found=text)
    return float(match[1]) / (1000 if match[2] == "ms" else 1)


def _arguments(element: Element, names: Names) -> dict[str, Term]:
    listed = element.attributes.get("namelist", "").split()
    found: dict[str, Term] = {name.lower(): Variable(variable(name, names, element)) for name in listed}
    for child in element.children:
        if child.name == "param":
            found[needed(child, "name").lower()] = _param(child, names)
        else:
            text = child.attributes.get("expr")
            inline = Constant(child.text, quoted=True)
            found["data"] = term(text, names, child.place) if text else inline
    return found


def _param(element: Element, names: Names) -> Term:
    only_one(element, "expr", "location")
    if "location" in element.attributes:
        return Variable(variable(element.attributes["location"], names, element))
    return term(needed(element, "expr"), names, element.place)


_READERS = {"raise": _raise, "assign": _assign, "log": _log, "if": _if, "send": _send, "cancel": _cancel}
