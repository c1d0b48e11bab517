"""Behaviour trees as skills (S4.7), with the extra `bt` (py_trees); a tree is ticked only while its skill is active.

```python
class Butler(Component):
    @tree_skill(success=Served, failure=NotServed)
    def serve(self, call: SkillCall[Any], item: str) -> Behaviour:
        return sequence(
            retry(action("grasp", lambda: self.arm.grasp(call, item), ends={"grasped"}), 3),
            fallback(condition("open", lambda: self.door), action("open", lambda: self.arm.push(call), {"pushed"})),
        )
```

No other module imports py_trees. Any `Behaviour` of py_trees may be a child.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Collection, Iterable, Mapping
from contextvars import ContextVar
from typing import Any, TypeVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector, Sequence
from py_trees.decorators import Repeat, Retry

from dsc.calls import SkillCall
from dsc.components.tree_skills import declare_tree, execute_action
from dsc.outcomes import Outcome
from dsc.skills import AfterCrash, SkillBody
from knowledge_base.facts import Delta

PERIOD = 0.1
"""Seconds between two ticks."""
FOREVER = -1
"""Argument `times` of `repeat` for repetition without end."""
_observe: ContextVar[Callable[[Delta], None]] = ContextVar("observe")
"""Function that receives the observations of a tree's actions; each skill runs in a separate context."""
_Body = TypeVar("_Body", bound=Callable[..., Behaviour])


def tree_skill(
    success: type[Outcome],
    failure: type[Outcome],
    *,
    reports: Iterable[type[Outcome]] = (),
    period: float = PERIOD,
    after_crash: AfterCrash = "sense",
) -> Callable[[_Body], _Body]:
    """Declare a method that returns a behaviour tree as a skill; each call creates a new tree.

    The annotations of parameters are their types, as for `skill`. The observation of an action is asserted when the
    action ends, regardless of the skill's outcome.

    Args:
        success: the outcome if the root of the tree succeeds, a class without attributes.
        failure: the outcome if the root of the tree fails, a class without attributes.
        reports: the classes of the outcomes that actions report before the end.
        period: seconds of run time between two ticks.
        after_crash: as for `skill`; a repeated skill starts its tree again from the root.

    Raises:
        InputError: an outcome is not a class, or `success` or `failure` has attributes.
        SchemaError: an annotation has no valid type.
    """

    async def execute(_: Any, body: SkillBody, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
        _observe.set(call.observe)
        root: Behaviour = body(call, **arguments)
        try:
            root.tick_once()
            while root.status is Status.RUNNING:
                await call.clock.sleep(period)
                root.tick_once()
            succeeded = root.status is Status.SUCCESS
        finally:
            await _halt(root)
        return Outcome((success if succeeded else failure).event)

    return declare_tree((success, failure), reports, after_crash, execute)


def sequence(*children: Behaviour, name: str = "sequence", reactive: bool = False) -> Behaviour:
    """Return a node that runs the children in order, until one fails.

    If `reactive`, each tick starts with the first child. A condition before an action is then true during the whole
    action; without `reactive`, the condition is only tested before the action begins. If `reactive`, an action that
    precedes another action is started again at each tick.
    """
    return Sequence(name, memory=not reactive, children=list(children))


def fallback(*children: Behaviour, name: str = "fallback", reactive: bool = False) -> Behaviour:
    """Return a node that runs the children in order, until one succeeds.

    If `reactive`, each tick starts with the first child.
    """
    return Selector(name, memory=not reactive, children=list(children))


def repeat(child: Behaviour, times: int = FOREVER) -> Behaviour:
    """Return a node that runs the child `times` times, and fails as soon as the child fails."""
    return Repeat(f"repeat {child.name}", child, times)


def retry(child: Behaviour, times: int) -> Behaviour:
    """Return a node that runs the child until it succeeds, at most `times` times."""
    return Retry(f"retry {child.name}", child, times)


def condition(name: str, holds: Callable[[], bool]) -> Behaviour:
    """Return a leaf that succeeds if `holds()` is true at the tick, else fails."""
    return _Condition(name, holds)


def action(name: str, begin: Callable[[], Awaitable[Outcome]], ends: Collection[str]) -> Behaviour:
    """Return a leaf that runs a coroutine, e.g. another skill.

    The leaf succeeds if the coroutine ends with an outcome in `ends`, else it fails. An exception of the coroutine ends
    the whole skill. The coroutine is cancelled when the tree leaves the leaf.
    """
    return _Action(name, begin, frozenset(ends))


class _Condition(Behaviour):
    def __init__(self, name: str, holds: Callable[[], bool]) -> None:
        super().__init__(name)
        self._holds = holds

    def update(self) -> Status:
        return Status.SUCCESS if self._holds() else Status.FAILURE


class _Action(Behaviour):
    def __init__(self, name: str, begin: Callable[[], Awaitable[Outcome]], ends: frozenset[str]) -> None:
        super().__init__(name)
        self._begin = begin
        self._ends = ends
        self._task: asyncio.Future[Outcome] | None = None
        self.stopping: list[asyncio.Future[Outcome]] = []

    def initialise(self) -> None:
        self._task = asyncio.ensure_future(self._execute())

    async def _execute(self) -> Outcome:
        return await execute_action(self.name, self._begin, _observe.get())

    def update(self) -> Status:
        if self._task is None or not self._task.done():
            return Status.RUNNING
        return Status.SUCCESS if self._task.result().event in self._ends else Status.FAILURE

    def terminate(self, new_status: Status) -> None:
        if new_status is Status.INVALID and self._task is not None and not self._task.done():
            self._task.cancel()
            self.stopping.append(self._task)


async def _halt(root: Behaviour) -> None:
    """Cancel the running actions of the tree, and wait until they have stopped."""
    if root.status is Status.RUNNING:
        root.stop(Status.INVALID)
    stopping = [task for one in root.iterate() if isinstance(one, _Action) for task in one.stopping]
    if stopping:
        await asyncio.gather(*stopping, return_exceptions=True)
