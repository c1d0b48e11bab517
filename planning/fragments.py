"""Domains from fragments (S4.6): each module ships a fragment of PDDL, and merged fragments form a domain.

Fragments are merged as text forms, before name resolution: one may use names that another declares, in any order. Equal
declarations are merged; contradictory ones raise an error with both places.
"""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from knowledge_base.errors import InputError
from knowledge_base.pddl.action_text import united
from knowledge_base.pddl.domain_text import DomainText, parse_domain, read_domain
from knowledge_base.world.schema import agreed_names

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from dsc.components.component import Component


def shipped_by(components: Iterable[Component]) -> list[DomainText]:
    """Return the fragments that components ship, once for each class.

    Raises:
        InputError: a file cannot be read, or does not contain a domain.
    """
    kinds = dict.fromkeys(type(component) for component in components)
    return [_read(kind.domain, kind.__name__) for kind in kinds if kind.domain is not None]


def merged_text(texts: Sequence[DomainText]) -> DomainText:
    """Return the union of the fragments, under the name of the first.

    Raises:
        SchemaError: two types, constants or actions of one name differ. (The schema made from the result detects
            this for other declarations.)
    """
    first = texts[0]
    return DomainText(
        name=first.name,
        requirements=tuple(dict.fromkeys(r for text in texts for r in text.requirements)),
        types=agreed_names((text.types for text in texts), "type"),
        constants=agreed_names((text.constants for text in texts), "constant"),
        predicates=tuple(declared for text in texts for declared in text.predicates),
        functions=tuple(declared for text in texts for declared in text.functions),
        actions=united(action for text in texts for action in text.actions),
        axioms=tuple(dict.fromkeys(axiom for text in texts for axiom in text.axioms)),
        notes=tuple(note for text in texts for note in text.notes),
    )


@contextmanager
def searched(texts: Sequence[DomainText]) -> Iterator[None]:
    """Add the names of the fragments to an error about a name that none of them declares."""
    sources = dict.fromkeys(text.source or text.name for text in texts)
    try:
        yield
    except InputError as error:
        if error.found is not None and len(sources) > 1:
            error.message += f" in {', '.join(sources)}"
        raise


def _read(shipped: Path | str, owner: str) -> DomainText:
    return read_domain(shipped) if isinstance(shipped, Path) else parse_domain(shipped, f"{owner}.domain")
