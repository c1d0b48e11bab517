"""Executable content (SCXML 4) as internal actions in the written form of plots."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from dsc.errors import NotExpressibleError
from dsc.scxml.document import STATES, Element
from dsc.scxml.ecmascript import MAX_WHOLE, condition, joined, term
from dsc.scxml.value_kinds import NO_VALUE, WHOLE, Scope, Sent
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.syntax.expression import Constant, Term, Variable
from knowledge_base.spelling import is_plain_name

Form = dict[str, Any]

_PROCESSORS = frozenset({"", "scxml", "http://www.w3.org/TR/scxml/#SCXMLEventProcessor"})
_DELAY = re.compile(r"(\d+\.?\d*|\.\d+)(ms|s)")


def actions(elements: Iterable[Element], scope: Scope) -> list[Form]:
    """Return the actions for elements of executable content, in order and in written form.

    Raises:
        NotExpressibleError: an element has no counterpart in action plots.
        InputError: an attribute is missing or wrong.
    """
    return [_READERS[element.name](element, scope) for element in elements]


def needed(element: Element, attribute: str) -> str:
    """Return the value of a required attribute; raise `InputError` if the attribute is missing."""
    if not element.attributes.get(attribute):
        raise InputError(f"<{element.name}> needs the attribute '{attribute}'", place=element.place)
    return element.attributes[attribute]


def only_one(element: Element, *attributes: str) -> None:
    """Raise `InputError` if the element has more than one of the attributes, which exclude each other."""
    both = [name for name in attributes if name in element.attributes]
    if len(both) > 1:
        message = f"<{element.name}> has both '{both[0]}' and '{both[1]}'"
        raise InputError(message, place=element.place, found=both[1])


def variable(name: str, scope: Scope, element: Element) -> str:
    """Return the name of the plot's variable for a `data` name; raise `UnknownNameError` if it is not declared."""
    if name not in scope.names:
        raise UnknownNameError(f"there is no data '{name}'", place=element.place, found=name, valid=scope.names)
    return scope.names[name]


def assigned(element: Element, scope: Scope) -> Term | None:
    """Return the value of a `data` or `assign`: its expression or content (SCXML B.2.1); `None` without a value."""
    if "expr" in element.attributes:
        if element.text:
            raise InputError(f"<{element.name}> has both 'expr' and content", place=element.place)
        return term(element.attributes["expr"], scope, element.place)
    found = _literal(element) if element.text else None
    if isinstance(found, Mapping):
        raise NotExpressibleError(element.name, "an object is not a value of a variable", place=element.place)
    return found


def set_at_first(root: Element, scope: Scope) -> frozenset[str]:
    """Return the variables that have a value before any use: the first state sets them, or each path out of it does."""
    tops = [child for child in root.children if child.name in STATES]
    named = root.attributes.get("initial")
    first = next((top for top in tops if named is None or any(_id(one) == named for one in top.walk())), None)
    if first is None:
        return frozenset()
    entries = [child for child in first.children if child.name == "onentry"]
    found = set(_set_by(entries[0], scope)) if entries else set()
    ways = [child for child in first.children if child.name == "transition" and "target" in child.attributes]
    if ways and not any(child.name in STATES for child in first.children):
        always = set.intersection(*(set(_set_by(way, scope)) for way in ways))
        found |= {name for name in always if _mentions(first, name) == len(ways)}
    data = [one for one in root.walk() if one.name == "data"]
    return frozenset(name for name in found if not any(_mentions(one, name) for one in data))


def _set_by(block: Element, scope: Scope) -> Iterator[str]:
    """Yield the variables to which the leading `assign` actions of a block assign constants."""
    for action in block.children:
        if action.name != "assign" or not isinstance(assigned(action, scope), Constant):
            return
        yield needed(action, "location")


def _mentions(element: Element, name: str) -> int:
    """Return the number of occurrences of a name in the expressions and locations of an element and its content."""
    word = re.compile(rf"(?<![\w$.]){re.escape(name)}(?![\w$])")
    texts = (text for one in element.walk() for key, text in one.attributes.items() if key != "id")
    return sum(len(word.findall(text)) for text in texts)


def _id(element: Element) -> str | None:
    return element.attributes.get("id")


def fired(element: Element, scope: Scope) -> Sent:
    """Return the event that a `raise` or `send` element fires."""
    if element.name == "raise":
        return Sent(needed(element, "event"), None, scope)
    return Sent(_constant(element, "event", scope), _read_data(element, scope), scope)


def _raise(element: Element, _: Scope) -> Form:
    return {"emit": needed(element, "event")}


def _assign(element: Element, scope: Scope) -> Form:
    location = variable(needed(element, "location"), scope, element)
    value = assigned(element, scope)
    if value is None:
        raise InputError("<assign> needs the attribute 'expr'", place=element.place)
    return {"assign": {location: value}}


def _log(element: Element, scope: Scope) -> Form:
    text = element.attributes.get("expr", "")
    parts = joined(text, scope, element.place) if text else []
    return {"log": tuple(parts), "label": element.attributes.get("label", "")}


def _if(element: Element, scope: Scope) -> Form:
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
        done = actions(inside, scope)
        if head.name == "else":
            form = done
        else:
            form = [{"if": condition(needed(head, "cond"), scope, head.place), "then": done, "else": form}]
    return form[0]


def _send(element: Element, scope: Scope) -> Form:
    if element.attributes.get("type", "") not in _PROCESSORS:
        raise NotExpressibleError("send/@type", "only the SCXML event processor is there", place=element.place)
    target = element.attributes.get("target", "")
    if target not in {"", "#_internal"}:
        raise NotExpressibleError("send/@target", "events go to the chart itself only", place=element.place)
    form: Form = {"emit": _constant(element, "event", scope), "with": _arguments(element, scope)}
    only_one(element, "id", "idlocation")
    if target:
        for name in ("delay", "delayexpr", "idlocation"):
            if name in element.attributes:
                raise NotExpressibleError(f"send/@{name}", "does not go with '#_internal'", place=element.place)
        return form
    if "id" in element.attributes:
        form["id"] = Constant(element.attributes["id"], quoted=True)
    if "idlocation" in element.attributes:
        form["into"] = variable(element.attributes["idlocation"], scope, element)
    return {**form, "delay": _delay(element, scope)}


def _cancel(element: Element, scope: Scope) -> Form:
    only_one(element, "sendid", "sendidexpr")
    if "sendidexpr" in element.attributes:
        return {"withdraw": term(element.attributes["sendidexpr"], scope, element.place)}
    return {"withdraw": Constant(needed(element, "sendid"), quoted=True)}


def _constant(element: Element, attribute: str, scope: Scope) -> str:
    """Return the value of an attribute, or the constant string of its expression form, e.g. `eventexpr` for `event`."""
    if f"{attribute}expr" not in element.attributes:
        return needed(element, attribute)
    only_one(element, attribute, f"{attribute}expr")
    found = term(element.attributes[f"{attribute}expr"], scope, element.place)
    if isinstance(found, Constant) and isinstance(found.value, str):
        return found.value
    raise NotExpressibleError(f"send/@{attribute}expr", "must be a string in quotes", place=element.place)


def _delay(element: Element, scope: Scope) -> float:
    if not {"delay", "delayexpr"} & element.attributes.keys():
        return 0
    text = _constant(element, "delay", scope)
    match = _DELAY.fullmatch(text)
    if match is None:
        raise InputError(f"'{text}' is not a delay such as 10ms or 1.5s", place=element.place, found=text)
    return float(match[1]) / (1000 if match[2] == "ms" else 1)


def _arguments(element: Element, scope: Scope) -> dict[str, Term]:
    """Return the data of a `send` by name in lower case; data without names have the name `data`."""
    found: dict[str, Term] = {}
    for name, value in (_read_data(element, scope) or {}).items():
        folded = name.lower() or "data"
        if folded in found:
            why = f"two are named '{folded}', in lower case"
            raise NotExpressibleError("param/@name", why, place=element.place)
        if not is_plain_name(folded):
            raise NotExpressibleError("param/@name", f"'{name}' is not a name for an attribute", place=element.place)
        found[folded] = value
    return found


def _read_data(element: Element, scope: Scope) -> dict[str, Term] | None:
    """Return an event's data by the spelling in the document; `None` without data.

    Content other than an object has the key `WHOLE`.
    """
    contents = [child for child in element.children if child.name == "content"]
    named: dict[str, Term] = {
        name: Variable(variable(name, scope, element)) for name in element.attributes.get("namelist", "").split()
    }
    for child in element.children:
        if child.name == "param":
            named[needed(child, "name")] = _param(child, scope)
    if not contents:
        return named or None
    if named or len(contents) > 1:
        raise InputError("<content> in <send> excludes 'namelist' and <param>", place=contents[0].place)
    return _content(contents[0], scope)


def _content(element: Element, scope: Scope) -> dict[str, Term]:
    if "expr" in element.attributes:
        if element.text:
            raise InputError("<content> has both 'expr' and content", place=element.place)
        return {WHOLE: term(element.attributes["expr"], scope, element.place)}
    found = _literal(element)
    return dict(found) if isinstance(found, Mapping) else {WHOLE: found}


def _literal(element: Element) -> Constant | Mapping[str, Constant]:
    """Return the content of an element as JSON; if it is not JSON, as a string with collapsed blanks (SCXML B.2.1)."""
    try:
        value = json.loads(element.text)
    except ValueError:
        value = " ".join(element.text.split())
    except RecursionError:
        value = None
    if isinstance(value, dict) and value and all(name and _is_scalar(one) for name, one in value.items()):
        return {name: _scalar(one) for name, one in value.items()}
    if not _is_scalar(value):
        why = "null, 'undefined', an array or an object in an object is not a value"
        raise NotExpressibleError(element.name, why, place=element.place)
    return _scalar(value)


def _is_scalar(value: object) -> bool:
    if isinstance(value, str):
        return value != NO_VALUE.value
    return isinstance(value, int | float) and abs(value) <= MAX_WHOLE


def _scalar(value: str | float) -> Constant:
    return Constant(value, quoted=isinstance(value, str))


def _param(element: Element, scope: Scope) -> Term:
    only_one(element, "expr", "location")
    if "location" in element.attributes:
        return Variable(variable(element.attributes["location"], scope, element))
    return term(needed(element, "expr"), scope, element.place)


_READERS = {"raise": _raise, "assign": _assign, "log": _log, "if": _if, "send": _send, "cancel": _cancel}
