"""Conditions on active states: the engine itself evaluates `(in-state NAME)`, as `In()` of SCXML (5.9.1).

NAME is a state of the plot that contains the condition.
"""

from __future__ import annotations

from collections.abc import Callable

from knowledge_base.language.syntax.expression import TRUE, Atom, Comparison, Constant, Expression, Or, parts_of
from knowledge_base.language.syntax.rewriting import with_atoms

IN_STATE = "in-state"
"""Name of the predicate that tests whether a state is active."""
FALSE = Or(())


def asked_states(e: Expression) -> list[str]:
    """Return the names of the states that the condition tests with `in-state`."""
    if isinstance(e, Comparison):
        return []
    if isinstance(e, Atom):
        asks = e.predicate == IN_STATE and len(e.args) == 1
        return [str(e.args[0].value)] if asks and isinstance(e.args[0], Constant) else []
    inner = [part for part in parts_of(e) if isinstance(part, Expression)]
    return [name for part in inner for name in asked_states(part)]


def settle(e: Expression, active: Callable[[str], bool]) -> Expression:
    """Return the condition with each `in-state` replaced by its truth value; the rest stays to be evaluated."""

    def truth(atom: Atom) -> Expression:
        if not _asks(atom):
            return atom
        name = atom.args[0]
        return TRUE if isinstance(name, Constant) and active(str(name.value)) else FALSE

    return with_atoms(e, truth)


def _asks(e: Atom) -> bool:
    return e.predicate == IN_STATE and len(e.args) == 1
