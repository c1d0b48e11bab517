"""SCXML documents: a reader of XML that records the line of each element, and the check for unsupported elements.

The reader refuses DTDs, entity declarations and processing instructions, and bounds size and depth.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

from dsc.errors import NotExpressibleError
from dsc.text.yaml import check_size
from knowledge_base.errors import InputError, ParseError, Place, UnknownNameError, shortened
from knowledge_base.origin import Origin, origin_of

NAMESPACE = "http://www.w3.org/2005/07/scxml"
MAX_DEPTH = 30
"""Upper bound of the depth of elements.

Each nested `parallel` adds four levels to the YAML of the plot, which must stay readable.
"""

ATTRIBUTES: Mapping[str, frozenset[str]] = {
    name: frozenset(words.split())
    for name, words in {
        "scxml": "initial name version datamodel binding exmode",
        "state": "id initial",
        "parallel": "id",
        "initial": "",
        "final": "id",
        "history": "id type",
        "transition": "event cond target type",
        "onentry": "",
        "onexit": "",
        "datamodel": "",
        "data": "id expr",
        "raise": "event",
        "assign": "location expr",
        "send": "event eventexpr target type id idlocation delay delayexpr namelist",
        "cancel": "sendid sendidexpr",
        "param": "name expr location",
        "content": "expr",
        "log": "label expr",
        "if": "cond",
        "elseif": "cond",
        "else": "",
    }.items()
}
"""Supported attributes, by the name of the supported element."""
STATES = frozenset({"state", "parallel", "final"})

_CHART = frozenset({"transition", "onentry", "onexit", "datamodel", "history"})
_ACTIONS = frozenset({"raise", "assign", "send", "cancel", "log", "if"})
CHILDREN: Mapping[str, frozenset[str]] = {
    "scxml": STATES | {"datamodel"},
    "state": STATES | _CHART | {"initial"},
    "parallel": frozenset({"state", "parallel"}) | _CHART,
    "initial": frozenset({"transition"}),
    "final": frozenset({"onentry"}),
    "history": frozenset({"transition"}),
    "transition": _ACTIONS,
    "onentry": _ACTIONS,
    "onexit": _ACTIONS,
    "datamodel": frozenset({"data"}),
    "send": frozenset({"param", "content"}),
    "if": _ACTIONS | {"elseif", "else"},
}
"""Names of the elements that are allowed directly inside an element, by the name of this element."""
_MEANINGLESS_IF_EMPTY = frozenset({"id", "target", "initial", "event", "location", "idlocation", "sendid"})
_HOLDS_TEXT = frozenset({"data", "assign", "content"})
_KNOWN_TO_SCXML = frozenset({"script", "foreach", "invoke", "finalize", "donedata", "onexit"})
_KNOWN_ATTRIBUTES = frozenset({"src", "targetexpr", "typeexpr", "srcexpr", "autoforward"})


@dataclass(slots=True)
class Element:
    """An XML element; it belongs to SCXML if it has the namespace of SCXML or none, and is `foreign` otherwise."""

    name: str
    attributes: Mapping[str, str]
    place: Place
    namespace: str = NAMESPACE
    children: list[Element] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    @property
    def foreign(self) -> bool:
        """Whether the element does not belong to SCXML."""
        return self.namespace not in {"", NAMESPACE}

    @property
    def text(self) -> str:
        """The element's text, without the text of inner elements, stripped."""
        return "".join(self.texts).strip()

    def walk(self) -> Iterator[Element]:
        """Yield the element and all inner elements, in document order."""
        yield self
        for child in self.children:
            yield from child.walk()


def read_xml(text: str, source: str | None = None, deepest: int = MAX_DEPTH) -> Element:
    """Return the root element of an XML text.

    Args:
        text: the document.
        source: the file name in messages.
        deepest: upper bound of the depth of elements.

    Raises:
        ParseError: the text is not well-formed XML, has a document type or entity declaration, or is too large or deep.
    """
    data = text.encode(errors="surrogatepass")  # the parser then reports half a surrogate pair with its place
    origin = origin_of(text, source)
    check_size(len(data), Place(origin.source))
    reader = _Reader(origin, deepest)
    try:
        reader.parser.Parse(data, True)  # noqa: FBT003  # expat takes no keywords here
    except expat.ExpatError as error:
        place = origin.place(error.lineno, error.offset + 1)
        raise ParseError(f"not readable as XML: {expat.ErrorString(error.code)}", place=place) from None
    return reader.root


def written(element: Element) -> str:
    """Return an element's name for messages; the name of a foreign element includes its namespace."""
    return f"<{element.name}>" + (f" of the namespace '{element.namespace}'" if element.foreign else "")


class _Reader:
    def __init__(self, origin: Origin, deepest: int) -> None:
        self._origin = origin
        self._deepest = deepest
        self._open: list[Element] = []
        self.root: Element
        self.parser = expat.ParserCreate("utf-8", namespace_separator=" ")
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.ProcessingInstructionHandler = self._instruction

    def _place(self) -> Place:
        return self._origin.place(self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        space, _, name = tag.rpartition(" ")
        own = {key: value for key, value in attributes.items() if " " not in key}
        element = Element(name, own, self._place(), namespace=space)
        if len(self._open) >= self._deepest:
            raise ParseError(f"nested deeper than {self._deepest} levels", place=element.place)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)

    def _end(self, _: str) -> None:
        self._open.pop()

    def _text(self, data: str) -> None:
        self._open[-1].texts.append(data)

    def _doctype(self, *_: object) -> None:
        raise ParseError("a document type (and with it entities) is not read", place=self._place())

    def _instruction(self, target: str, _: str) -> None:
        message = f"the processing instruction <?{target}?> has no counterpart"
        raise ParseError(message, place=self._place(), found=target)


def check(element: Element) -> None:
    """Raise an error if an element or its content is unknown, misplaced or without a counterpart in plots.

    Raises:
        NotExpressibleError: an element or attribute of SCXML has no counterpart in action plots.
        UnknownNameError: an element or attribute does not exist in SCXML, or is not allowed in its place.
        InputError: an attribute is empty, or text is misplaced.
    """
    known = ATTRIBUTES[element.name]
    for name in element.attributes:
        if name in _KNOWN_ATTRIBUTES:
            raise NotExpressibleError(f"{element.name}/@{name}", "has no counterpart", place=element.place)
        if name not in known:
            raise UnknownNameError(
                f"<{element.name}> has no attribute '{name}'", place=element.place, found=name, valid=known
            )
        if name in _MEANINGLESS_IF_EMPTY and not element.attributes[name].strip():
            raise InputError(f"the attribute '{name}' of <{element.name}> is empty", place=element.place)
    if element.text and element.name not in _HOLDS_TEXT:
        message = f"<{element.name}> holds the text '{shortened(element.text, 40)}', which belongs nowhere"
        raise InputError(message, place=element.place)
    valid = CHILDREN.get(element.name, frozenset())
    for child in element.children:
        if child.foreign or (child.name in _KNOWN_TO_SCXML and child.name not in valid):
            raise NotExpressibleError(child.name, "has no counterpart", place=child.place)
        if child.name not in valid:
            raise UnknownNameError(
                f"<{child.name}> is not allowed in <{element.name}>", place=child.place, found=child.name, valid=valid
            )
        check(child)
