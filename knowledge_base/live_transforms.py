"""Live transforms of a knowledge base: functions that a transform tree answers and receives, without storing them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from knowledge_base.conditions.installed import Installed
from knowledge_base.conditions.notification import Notifier
from knowledge_base.errors import SchemaError
from knowledge_base.facts import GEOMETRY, Delta, Fact
from knowledge_base.language.checking.vocabulary import VALUE_TYPES
from knowledge_base.world.state import WorldState

if TYPE_CHECKING:
    from knowledge_base.transforms.poses import Poses
    from knowledge_base.transforms.tree import News, TransformTree


class LiveTransforms:
    """The functions of one knowledge base that transform trees answer.

    Args:
        state: the present world.
        installed: the installed conditions.
        notifier: queues the calls of listeners.
        announce: queues the calls of the listeners that wait for a change of a program.
    """

    def __init__(
        self, state: WorldState, installed: Installed, notifier: Notifier, announce: Callable[[], None]
    ) -> None:
        self._state, self._installed, self._notifier = state, installed, notifier
        self._announce = announce
        self._ends: dict[str, Callable[[], None]] = {}
        self._changed: deque[Fact | str] = deque()  # a name is a function whose poses may all have changed
        self._is_publishing = False

    def bind(self, function: str, tree: TransformTree) -> Callable[[], None]:
        """Let a tree answer a function; see `KnowledgeBase.bind_transforms`."""
        from knowledge_base.transforms.poses import Poses  # noqa: PLC0415  loads scipy

        poses = Poses(function, tree)
        with self._notifier.lock:
            self._require_binary(function)
            if function in (*self._state.poses, *(fluent.predicate for fluent in self._state.references)):
                raise SchemaError(f"'{function}' has a transform tree or a source already; end the other one first")
            self._state.poses[function] = poses
        leave = tree.subscribe(partial(self._receive, poses))

        def withdraw() -> None:
            leave()
            with self._notifier.lock:
                if self._state.poses.get(function) is poses:
                    del self._state.poses[function], self._ends[function]
            self._change(function)

        self._ends[function] = withdraw
        self._change(function)
        return withdraw

    def close(self) -> None:
        """End all bindings."""
        for withdraw in [*self._ends.values()]:
            withdraw()

    @contextmanager
    def publish(self, effective: Delta) -> Iterator[Delta]:
        """Publish the values of the bound functions to their trees; the result is the rest of the change.

        The conditions are evaluated at the end of the block, in which the rest is stored.

        Raises:
            TransformError: a tree refuses a value; then it stays unchanged.
        """
        stored = {one: content for one, content in effective.values.items() if one.predicate not in self._state.poses}
        self._is_publishing = True
        try:
            for poses in self._state.poses.values():
                poses.publish(effective.values)
            yield replace(effective, values=stored)
        finally:
            self._is_publishing = False
            self.refresh()

    def reread(self) -> None:
        """Evaluate all conditions that read poses, e.g. after the first fact about a frame; the caller has the lock."""
        self._changed.extend(self._state.poses)
        self.refresh()

    def refresh(self) -> None:
        """Evaluate the conditions on changed poses, once for all changes since the last call."""
        with self._notifier.lock:
            changed: dict[Fact | str, None] = {}
            while self._changed:
                changed[self._changed.popleft()] = None
            if not changed:
                return
            for name in changed:
                if isinstance(name, str):
                    self._installed.reread(name)
            self._installed.refreshed(
                *(one for one in changed if isinstance(one, Fact) and one.predicate not in changed)
            )
            self._announce()

    def _receive(self, poses: Poses, news: Mapping[str, News]) -> None:
        """Receive changes of a tree from any thread."""
        gone = poses.expire(news)
        if "linked" in news.values():
            self._change(poses.function)
        elif gone:
            self._change(*gone)

    def _change(self, *changed: Fact | str) -> None:
        self._changed.extend(changed)
        if not self._is_publishing:  # otherwise the thread that publishes refreshes
            self.refresh()
            self._notifier.deliver()

    def _require_binary(self, function: str) -> None:
        schema = self._state.schema
        parameters = schema.function(function).parameters
        if (
            schema.result(function) != GEOMETRY
            or len(parameters) != 2
            or any(set(p.types) & set(VALUE_TYPES) for p in parameters)
        ):
            raise SchemaError(
                f"a transform tree answers a function of two objects, ({function} ?frame ?reference) - geometry"
            )
