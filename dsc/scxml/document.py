"""XML reader with the line of each element; without DTD, entities or instructions, and bounded in size and depth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

from dsc.text.yaml import check_size
from knowledge_base.errors import ParseError, Place

NAMESPACE = "http://www.w3.org/2005/07/scxml"
MAX_DEPTH = 30
"""Depth of elements. Each nested `parallel` makes a plot four levels deeper, and its YAML must stay readable."""


@dataclass(slots=True)
class Element:
    """An element of the SCXML namespace (or of none), or of another one, which is `foreign`."""

    name: str
    attributes: Mapping[str, str]
    place: Place
    namespace: str = NAMESPACE
    children: list[Element] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    @property
    def foreign(self) -> bool:
        """Whether it is not an element of SCXML."""
        return self.namespace not in {"", NAMESPACE}

    @property
    def text(self) -> str:
        """Its text besides elements, stripped."""
        return "".join(self.texts).strip()

    def walk(self) -> Iterator[Element]:
        """Yield the element and all elements inside it."""
        yield self
        for child in self.children:
            yield from child.walk()


def read_xml(text: str, source: str | None = None) -> Element:
    """Return the root element.

    Raises:
        ParseError: it is not well-formed XML, has a document type or an entity declaration, or is too large or deep.
    """
    data = text.encode(errors="surrogatepass")  # half a surrogate pair is refused with its place
    check_size(len(data), Place(source))
    reader = _Reader(source)
    try:
        reader.parser.Parse(data, True)  # noqa: FBT003  # expat takes no keywords here
    except expat.ExpatError as error:
        place = Place(source, error.lineno, error.offset + 1)
        raise ParseError(f"not readable as XML: {expat.ErrorString(error.code)}", place=place) from None
    return reader.root


def written(element: Element) -> str:
    """Return an element's name for messages; one of another namespace with that namespace."""
    return f"<{element.name}>" + (f" of the namespace '{element.namespace}'" if element.foreign else "")


class _Reader:
    def __init__(self, source: str | None) -> None:
        self._source = source
        self._open: list[Element] = []
        self.root: Element
        self.parser = expat.ParserCreate("utf-8", namespace_separator=" ")
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.ProcessingInstructionHandler = self._instruction

    def _place(self) -> Place:
        return Place(self._source, self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1)

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        space, _, name = tag.rpartition(" ")
        own = {key: value for key, value in attributes.items() if " " not in key}
        element = Element(name, own, self._place(), namespace=space)
        if len(self._open) >= MAX_DEPTH:
            raise ParseError(f"nested deeper than {MAX_DEPTH} levels", place=element.place)
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
