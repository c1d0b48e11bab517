"""The causal links of a plan that stand: a model for tests of the order and of traces."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from planning.ordering.partial_order import PRESENT, CausalLink


def standing(links: Iterable[CausalLink], done: Collection[int], begun: Collection[int]) -> tuple[CausalLink, ...]:
    """Return the links whose facts must hold now: all providers of a fact are done, and its user has not begun."""
    waiting = [link for link in links if link.user not in begun]
    coming = {(link.fact, link.user) for link in waiting if link.provider not in {PRESENT, *done}}
    return tuple(link for link in waiting if (link.fact, link.user) not in coming)
