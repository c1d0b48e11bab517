"""The outer form of PDDL domain and problem files, and the constructs that are refused.

A file has the form `(define (domain NAME) (:section ...) ...)`. The error for a refused construct suggests planners
that support it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from knowledge_base.errors import ParseError, Place, UnsupportedConstructError, nearest, printable
from knowledge_base.language.syntax.sexpr import Group, Node, Word, read
from knowledge_base.origin import Origin, origin_of

REQUIREMENTS = frozenset({
    ":strips", ":typing", ":negative-preconditions", ":disjunctive-preconditions", ":equality",
    ":existential-preconditions", ":universal-preconditions", ":quantified-preconditions",
    ":conditional-effects", ":fluents", ":numeric-fluents", ":object-fluents", ":adl", ":durative-actions",
    ":duration-inequalities", ":continuous-effects", ":derived-predicates", ":timed-initial-literals",
    ":preferences", ":constraints", ":action-costs", ":time", ":domain-axioms", ":goal-utilities", ":hierarchy",
    ":method-preconditions", ":contingent", ":multi-agent",
})  # fmt: skip
"""Requirements of PDDL 1.2 to 3.1 and of related languages; only constructs in use are checked."""


@dataclass(frozen=True, slots=True)
class Definition:
    """One `(define ...)`: its name, and its sections in order, each with its keyword in lower case."""

    name: str
    place: Place
    sections: tuple[tuple[str, Group], ...]

    def single(self, keyword: str) -> Group | None:
        """Return the only section with that keyword, or `None` if the section is missing.

        Raises:
            ParseError: two sections have that keyword.
        """
        found = [group for name, group in self.sections if name == keyword]
        if len(found) > 1:
            raise ParseError(f"a second '{keyword}' section; the first is at {found[0].place}", place=found[1].place)
        return found[0] if found else None

    def nodes(self, keyword: str) -> Sequence[Node]:
        """Return the content of that section after its keyword; empty if the section is missing."""
        group = self.single(keyword)
        return group.items[1:] if group else ()

    def requirements(self) -> tuple[str, ...]:
        """Return the `:requirements` in lower case, including unknown ones."""
        return tuple(word(node, "a requirement").folded() for node in self.nodes(":requirements"))

    def notes(self) -> Iterator[str]:
        """Yield remarks without influence on the result: unknown requirements, each with its place."""
        for node in self.nodes(":requirements"):
            found = word(node, "a requirement")
            if found.folded() not in REQUIREMENTS:
                meant = nearest(found.text, REQUIREMENTS)
                hint = f"; did you mean '{meant}'?" if meant else ""
                yield f"{found.place}: PDDL has no requirement '{printable(found.text)}'{hint}"


def read_definition(text: str, source: str | None, kind: str, known: Collection[str]) -> Definition:
    """Return the definition in the text of a file, which must contain only one definition.

    Args:
        text: the text of the file.
        source: name of the file for messages.
        kind: `domain` or `problem`.
        known: the keywords of the sections that the file may contain.

    Raises:
        ParseError: the text is not a definition of that kind, or a section is unknown.
        UnsupportedConstructError: no planner here supports a section of the file.
    """
    origin = origin_of(text, source)
    define = _define(read(text, origin), origin)
    if len(define.items) < 2 or not isinstance(define.items[1], Group):
        raise ParseError(f"'define' is followed by ({kind} NAME)", place=define.place)
    name, place = _name(define.items[1], kind)
    sections = tuple(_section(node, kind, known) for node in define.items[2:])
    return Definition(name, place, sections)


def word(node: Node, what: str) -> Word:
    """Return `node`, which must be a word.

    Raises:
        ParseError: `node` is a group; `what` is the expected word in the message.
    """
    if isinstance(node, Group):
        raise ParseError(f"{what} is expected here, not '('", place=node.place)
    return node


def _define(nodes: list[Node], origin: Origin) -> Group:
    if not nodes:
        raise ParseError("the file is empty; (define ...) is expected", place=origin.place(1, 1))
    if len(nodes) > 1:
        raise ParseError("the (define ...) ends before this; a file holds one", place=nodes[1].place)
    first = nodes[0]
    if isinstance(first, Word) or first.head() != "define":
        raise ParseError("a PDDL file begins with (define", place=first.place)
    return first


def _name(group: Group, kind: str) -> tuple[str, Place]:
    head = group.head()
    if head != kind:
        misspelt = head not in ("domain", "problem")  # the other kind of file is not a typing error
        raise ParseError(
            f"a {kind} file is expected, this defines a '{head}'",
            place=group.place,
            found=head,
            valid=(kind,) if misspelt else (),
        )
    if len(group.items) != 2:
        raise ParseError(f"a {kind} has one name: ({kind} NAME)", place=group.place)
    name = word(group.items[1], "a name")
    return name.folded(), name.place


def _section(node: Node, kind: str, known: Collection[str]) -> tuple[str, Group]:
    head = node.head() if isinstance(node, Group) else None
    if not isinstance(node, Group) or head is None:
        raise ParseError(f"a section of the {kind} is expected: (:keyword ...)", place=node.place)
    if head in SECTIONS:
        raise refused(SECTIONS[head], head, node.place)
    if head not in known:
        raise ParseError(f"a {kind} has no section '{head}'", place=node.items[0].place, found=head, valid=known)
    return head, node


_HYBRID = "hybrid planners (PDDL+), such as ENHSP or OPTIC"
_TEMPORAL = "temporal planners, such as OPTIC or Tamer"
_HIERARCHICAL = "hierarchical planners (HDDL), such as Aries or PANDA"
_CONTINGENT = "contingent planners, such as CPOR"
_WHOLE_PLANS = "planners for PDDL 3, such as OPTIC or SGPlan"
_CHANCE = "probabilistic planners (PPDDL), such as FF-Replan"
_OBJECTS = "planners with object fluents, such as Tamer"


@dataclass(frozen=True, slots=True)
class _Construct:
    """The meaning of a construct in a few words, and the planners that support it."""

    meaning: str
    engines: str


SECTIONS: Mapping[str, _Construct] = {
    ":process": _Construct("numbers that change by themselves over time", _HYBRID),
    ":event": _Construct("changes that happen by themselves", _HYBRID),
    ":task": _Construct("tasks that methods break down", _HIERARCHICAL),
    ":method": _Construct("ways to break a task down", _HIERARCHICAL),
    ":htn": _Construct("tasks to be broken down by methods", _HIERARCHICAL),
    ":constraints": _Construct("conditions on whole plans", _WHOLE_PLANS),
}
"""Refused sections of domains and problems, by keyword."""

ACTION_PARTS: Mapping[str, _Construct] = {
    ":observe": _Construct("observations during the execution of the plan", _CONTINGENT),
}

_TRAJECTORIES = (
    *("always", "sometime", "within", "at-most-once"),
    *("sometime-after", "sometime-before", "hold-during", "hold-after"),
)
_FORMS: Mapping[str, _Construct] = {
    "preference": _Construct("conditions that a plan may violate", _WHOLE_PLANS),
    "oneof": _Construct("a world with an unknown first state", _CONTINGENT),
    "unknown": _Construct("a world with an unknown first state", _CONTINGENT),
    "probabilistic": _Construct("effects that happen by chance", _CHANCE),
    **dict.fromkeys(_TRAJECTORIES, _Construct("conditions on whole plans", _WHOLE_PLANS)),
}
_CONTINUOUS = _Construct("numbers that change during the action", _HYBRID)
TIMED_INITIAL = _Construct("facts that change by themselves at a given time", _TEMPORAL)
OBJECT_FLUENTS = _Construct("functions whose values are things", _OBJECTS)
DURATION_AT_END = _Construct("a duration that is chosen at the end", _TEMPORAL)
ACROSS_TIMES = _Construct("an effect at one time under a condition at another", _TEMPORAL)
CHOSEN_DURATION = _Construct("an effect that depends on a chosen duration", _TEMPORAL)


def refused(construct: _Construct, called: str, place: Place | None) -> UnsupportedConstructError:
    """Return the error for a construct that was found; `called` is its name as written."""
    return UnsupportedConstructError(called, construct.meaning, construct.engines, place=place)


def refuse_forms(node: Node) -> None:
    """Raise `UnsupportedConstructError` for the first unsupported form in a condition or effect.

    A predicate may have the name of such a form; only a form has groups as arguments.
    """
    if isinstance(node, Word):
        if node.folded() == "#t" and not node.quoted:
            raise refused(_CONTINUOUS, node.text, node.place)
        return
    head = node.head() or ""
    if head in _FORMS and any(isinstance(part, Group) for part in node.items):
        raise refused(_FORMS[head], head, node.place)
    for part in node.items:
        refuse_forms(part)
