"""Reader of SCXML documents as action plots of dialect `scxml`.

| SCXML | plot |
|---|---|
| `state`, `final`, `history` | state of the same name |
| `parallel` | state with a region for each child, named as the child and holding only it |
| `transition` | under `on` by its descriptors, or under `always` |
| `onentry`, `onexit` | internal actions in `entry` and `exit`; of several each is a `block` |
| `data` | variable, in lower case |
| `raise`; `send`, with or without a delay | `emit`; `emit` with a `delay` |
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import PurePath
from typing import Any

from dsc.errors import NotExpressibleError
from dsc.events import RESERVED, TIMERS
from dsc.model.plot import ActionPlot, Path
from dsc.scxml.document import STATES, Element, check, read_xml, written
from dsc.scxml.ecmascript import condition
from dsc.scxml.executable_content import Form, actions, assigned, fired, needed, set_at_first, variable
from dsc.scxml.value_kinds import BOOLEAN, NO_VALUE, NUMBER, TEXT, UNDEFINED, Scope, compute_kinds
from dsc.text.yaml import Document, read_model
from knowledge_base.errors import InputError, Place
from knowledge_base.language.syntax.expression import Constant, Term, free_variables
from knowledge_base.spelling import is_plain_name


def parse_scxml(text: str, source: str | None = None) -> ActionPlot:
    """Return the plot for an SCXML document; `source` is the file name in messages.

    Raises:
        ParseError: the text is not XML, has a document type, or is too large or deep.
        NotExpressibleError: an element has no counterpart in action plots.
        InputError: the text is not SCXML; the message has file, line and the nearest valid name.
    """
    root = read_xml(text, source)
    if root.name != "scxml" or root.foreign:
        raise InputError(f"<scxml> was expected; found {written(root)}", place=root.place)
    return _Reader(root, source).plot()


class _Reader:
    def __init__(self, root: Element, source: str | None) -> None:
        check(root)
        self._root, self._source = root, source
        self._known = Scope({})
        self._places: dict[Path, Place] = {}
        self._note((), root.place)
        self._unnamed = 0

    def plot(self) -> ActionPlot:
        root = self._root
        if root.attributes.get("datamodel", "ecmascript") not in {"ecmascript", "null"}:
            raise NotExpressibleError("scxml/@datamodel", "only ecmascript is read", place=root.place)
        if root.attributes.get("binding", "early") != "early":
            raise NotExpressibleError("scxml/@binding", "data are bound early", place=root.place)
        if root.attributes.get("version", "1.0") != "1.0":
            raise InputError("the version of SCXML is 1.0", place=root.place, found=root.attributes["version"])
        if not any(child.name in STATES for child in root.children):
            raise InputError("a chart needs at least one state", place=root.place)
        form: Form = {"plot": self._name(), "dialect": "scxml", "variables": self._variables()}
        form |= self._scope(root, ())
        received = self._known.data.received
        form["receives"] = {event: _declare_types(attributes) or None for event, attributes in received.items()}
        return read_model(ActionPlot, Document(form, self._places)).written_at(self._places)

    def _note(self, path: Path, place: Place) -> None:
        """Record the place of a part, and of those outer parts that are not elements of the document."""
        for length in range(1, len(path)):
            self._places.setdefault(path[:length], self._places[path[: length - 1]])
        self._places[path] = place

    def _name(self) -> str:
        given = self._root.attributes.get("name") or (PurePath(self._source).stem if self._source else "chart")
        name = re.sub(r"[^\w\-.]", "_", given)
        return name if re.match(r"[a-zA-Z_]", name) else f"_{name}"

    # -- data ----------------------------------------------------------------------------------------------

    def _variables(self) -> Form:
        data = [element for element in self._root.walk() if element.name == "data"]
        names: dict[str, str] = {}
        for element in data:
            name = needed(element, "id")
            if not is_plain_name(name.lower()):
                raise InputError(f"'{name}' is not a name for data", place=element.place, found=name)
            if name.lower() in names.values():
                raise InputError(f"two data are named '{name}', in lower case", place=element.place, found=name)
            names[name] = name.lower()
            self._note(("variables", name.lower()), element.place)
        self._known = Scope(names)
        self._compute_kinds()
        form: Form = {}
        for element in data:
            form[names[element.attributes["id"]]] = self._variable(element, form)
        return form

    def _compute_kinds(self) -> None:
        """Compute the kinds of all data; afterwards, translation refuses expressions that convert values."""
        known = self._known.data
        early = {self._known.names.get(name) for name in set_at_first(self._root, self._known)}
        given = [one for one in self._assignments(self._root, self._known) if one[1] is not None or one[0] not in early]
        known.received = {event: {} for event in self._find_received()}
        compute_kinds(known, given)

    def _assignments(self, element: Element, scope: Scope) -> Iterator[tuple[str, Term | None, Scope]]:
        """Yield variable, value and scope of each assignment inside an element; record the events that it fires."""
        for child in element.children:
            if child.name == "data":
                yield scope.names[child.attributes["id"]], assigned(child, scope), scope
            elif child.name == "assign":
                yield variable(needed(child, "location"), scope, child), assigned(child, scope), scope
            elif child.name in {"raise", "send"}:
                scope.data.sent.append(fired(child, scope))
            if "idlocation" in child.attributes:
                yield variable(child.attributes["idlocation"], scope, child), Constant("", quoted=True), scope
            yield from self._assignments(child, scope.on(_descriptors(child)) if child.name == "transition" else scope)

    def _variable(self, element: Element, before: Form) -> Form:
        initial = assigned(element, self._known)
        for name in free_variables(initial) if initial is not None else ():
            if name not in before:
                why = f"its value reads '{name}', which has none yet"
                raise NotExpressibleError("data/@expr", why, place=element.place)
        kinds = (self._known.data.kinds or {})[self._known.names[element.attributes["id"]]]
        if initial is None and UNDEFINED in kinds:
            initial = NO_VALUE
        form: Form = {"type": next(iter(kinds)) if len(kinds) == 1 and kinds <= {TEXT, NUMBER, BOOLEAN} else "symbol"}
        return form if initial is None else {**form, "initial": initial}

    def _find_received(self) -> list[str]:
        """Return the events for which the chart has a transition but which it does not itself fire."""
        own = {sent.event for sent in self._known.data.sent}
        heard = [e for one in self._root.walk() if one.name == "transition" for e in _descriptors(one)]
        plain = dict.fromkeys(event.removesuffix(".*").removesuffix(".") for event in heard)
        nobodys = own | RESERVED | {"*"}
        return [event for event in plain if event not in nobodys and not event.startswith(("done.", "error."))]

    # -- states --------------------------------------------------------------------------------------------

    def _scope(self, element: Element, path: Path) -> Form:
        """Return the keys `states` and `initial` of the chart or of a composite state."""
        states: Form = {}
        for child in element.children:
            if child.name in STATES or child.name == "history":
                name, form = self._state(child, (*path, "states"))
                _new(name, states, child)
                states[name] = form
        form = {"states": states}
        first = self._initial(element)
        return form if first is None else {**form, "initial": first}

    def _initial(self, element: Element) -> str | None:
        targets = element.attributes.get("initial", "").split()
        for child in (child for child in element.children if child.name == "initial"):
            transition = _only(child)
            _default(transition)
            if transition.children:
                raise NotExpressibleError("initial", "its transition cannot act", place=child.place)
            targets += transition.attributes.get("target", "").split()
        if len(targets) > 1:
            raise NotExpressibleError("initial", "only one state can be the first", place=element.place)
        return targets[0] if targets else None

    def _state(self, element: Element, around: Path) -> tuple[str, Form]:
        self._unnamed += 1
        name = element.attributes.get("id") or f"{element.name}_{self._unnamed}"
        if len(name.split()) != 1:
            raise InputError(f"the id '{name}' has a blank", place=element.place, found=name)
        path = (*around, name)
        self._note(path, element.place)
        if element.name == "history":
            return name, self._history(element)
        form: Form = {"final": True} if element.name == "final" else {}
        for key, tag in (("entry", "onentry"), ("exit", "onexit")):
            inside = [child.children for child in element.children if child.name == tag and child.children]
            blocks = [actions(children, self._known) for children in inside]
            if blocks:
                form[key] = blocks[0] if len(blocks) == 1 else [{"block": block} for block in blocks]
        self._transitions(element, form, path)
        return name, form | self._inside(element, path)

    def _inside(self, element: Element, path: Path) -> Form:
        if not any(child.name in STATES for child in element.children):
            for child in (child for child in element.children if child.name == "history"):
                raise InputError("a history needs sibling states", place=child.place)
            if self._initial(element) is not None:
                raise InputError("there is no state inside to begin with", place=element.place)
            if element.name == "parallel":
                raise NotExpressibleError("parallel", "without states it is complete immediately", place=element.place)
            return {}
        if element.name == "state":
            return self._scope(element, path)
        regions: Form = {}
        connectors: Form = {}
        for child in element.children:
            if child.name == "history":
                name, form = self._state(child, (*path, "connectors"))
                _new(name, connectors, child)
                connectors[name] = form
            elif child.name in STATES:
                key = child.attributes.get("id") or f"{child.name}_{self._unnamed + 1}"
                name, form = self._state(child, (*path, "regions", key, "states"))
                _new(name, regions, child)
                regions[name] = {"states": {name: form}}
        return {"regions": regions, "connectors": connectors}

    def _history(self, element: Element) -> Form:
        default = _only(element)
        _default(default)
        targets = default.attributes.get("target", "").split()
        depth = element.attributes.get("type", "shallow")
        if depth not in {"shallow", "deep"}:
            valid = ("shallow", "deep")
            raise InputError("a history is shallow or deep", place=element.place, found=depth, valid=valid)
        if len(targets) != 1:
            raise NotExpressibleError("history", "its default is one state", place=element.place)
        return {"history": depth, "to": targets[0], "do": actions(default.children, self._known)}

    # -- transitions ---------------------------------------------------------------------------------------

    def _transitions(self, element: Element, form: Form, path: Path) -> None:
        """Add the transitions of an element to `form` in document order.

        The order also holds for transitions with equal descriptors between which other transitions occur.
        """
        on: dict[str, list[Form]] = {}
        always: list[Form] = []
        repeats: Counter[str] = Counter()
        for child in (child for child in element.children if child.name == "transition"):
            words = _descriptors(child)
            if not words:
                self._note((*path, "always", len(always)), child.place)
                always.append(self._transition(child))
                continue
            for word in TIMERS.intersection(words):
                problem = f"'{word}' is what the executive's clock says"
                raise NotExpressibleError("transition/@event", problem, place=child.place)
            key = _key(" ".join(words), on, repeats)
            self._note((*path, "on", key, len(on.setdefault(key, []))), child.place)
            on[key].append(self._transition(child))
        form |= {key: value for key, value in (("on", on), ("always", always)) if value}

    def _transition(self, element: Element) -> Form:
        targets: list[Any] = element.attributes.get("target", "").split()
        kind = element.attributes.get("type", "external")
        if kind not in {"internal", "external"}:
            valid = ("internal", "external")
            raise InputError("a transition is internal or external", place=element.place, found=kind, valid=valid)
        scope = self._known.on(_descriptors(element))
        form: Form = {"do": actions(element.children, scope), "internal": kind == "internal"}
        if targets:
            form |= {"to": targets[0], "also": targets[1:]}
        if "cond" in element.attributes:
            form["when"] = condition(element.attributes["cond"], scope, element.place)
        return form


def _descriptors(transition: Element) -> list[str]:
    return transition.attributes.get("event", "").split()


def _key(event: str, on: dict[str, list[Form]], repeats: Counter[str]) -> str:
    """Return the key for the next transition in `on`: the last key if its descriptors are equal; else a new key."""
    # A repeated descriptor makes a different key with an equal meaning.
    again = f" {event.split(maxsplit=1)[0]}"
    key = event + again * repeats[event]
    while key in on and key != next(reversed(on)):
        repeats[event] += 1
        key = event + again * repeats[event]
    return key


def _new(name: str, known: Form, element: Element) -> None:
    if name in known:
        raise InputError(f"two states are named '{name}'", place=element.place, found=name)


def _default(transition: Element) -> None:
    """Raise an error for a trigger or guard in the transition of an `initial` or history (SCXML 3.6, 3.10)."""
    for name in ("event", "cond"):
        if name in transition.attributes:
            raise InputError(f"this transition is taken always, so it has no '{name}'", place=transition.place)


def _only(element: Element) -> Element:
    if len(element.children) != 1:
        raise InputError(f"<{element.name}> needs exactly one <transition>", place=element.place)
    return element.children[0]


def _declare_types(attributes: Mapping[str, str]) -> dict[str, str]:
    """Return the types of attributes by name; an attribute that is only compared for equality is a `symbol`."""
    return {name: kind or "symbol" for name, kind in attributes.items()}
