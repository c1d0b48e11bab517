"""Live values: the present values of terms of the knowledge base, e.g. `(pose cup1)` (S2.18)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Iterable, Mapping
from contextlib import ExitStack
from typing import Any

from dsc.dynamic.knowledge_situation import plain
from dsc.loop_calls import LoopCalls
from knowledge_base.language.evaluation.evaluator import evaluate_term
from knowledge_base.language.syntax.expression import Comparison, Term
from knowledge_base.store import KnowledgeBase


async def live_values(
    knowledge: KnowledgeBase, terms: Mapping[str, Term]
) -> AsyncGenerator[dict[str, Any] | None, None]:
    """Yield the present values of terms by name, and again after each change; `None` while a value is unknown.

    Changes that come faster than the reader reads are merged. Values are plain data, a geometry is a list of numbers.

    Raises:
        InputError: a term cannot be evaluated.
    """
    calls, changed = LoopCalls(), asyncio.Event()
    calls.bind()

    def wake(*_: object) -> None:
        calls.call(changed.set)

    last: dict[str, Any] | None = {}
    with ExitStack() as subscriptions:
        for subscribe in (knowledge.subscribe, knowledge.subscribe_to_sources, knowledge.subscribe_to_relations):
            subscriptions.callback(subscribe(wake))
        while True:
            changed.clear()
            found = _read(knowledge, terms)
            if found != last:
                yield found
                last = found
            await changed.wait()


def require_evaluable(terms: Iterable[Term], knowledge: KnowledgeBase) -> None:
    """Raise an error for a term that uses a name, number of arguments or object that the knowledge does not have.

    Raises:
        UnknownNameError, SchemaError: as for `KnowledgeBase.ask`.
    """
    for term in terms:
        knowledge.ask(Comparison("=", term, term, place=term.place))


def _read(knowledge: KnowledgeBase, terms: Mapping[str, Term]) -> dict[str, Any] | None:
    world = knowledge.overlay()
    values = {name: plain(evaluate_term(term, world)) for name, term in terms.items()}
    return None if None in values.values() else values
