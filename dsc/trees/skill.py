"""Trees of XML files as skills: a tree is ticked only while its skill is active (S4.7, S4.18).

```python
class Butler(Component):
    @tree_skill(success=Served, failure=NotServed)
    def serve(self, call: SkillCall[Any], item: str) -> BoundTree:
        leaves = {
            "DoorOpen": Condition(lambda: self.door_open),
            "OpenDoor": Action(lambda: self.open_door(call), ends={"opened"}),
            "Grasp": Action(lambda item: self.grasp(call, item), ends={"grasped"}),
        }
        return bind_tree(TREES, leaves, entries={"item": item})
```
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterable, Mapping
from functools import partial
from typing import Any, TypeVar

from dsc.calls import SkillCall
from dsc.components.tree_skills import declare_tree, execute_action
from dsc.outcomes import Outcome
from dsc.skills import AfterCrash, SkillBody
from dsc.trees.binding import Action, BoundLeaf, BoundTree, bind_leaf, convert_port, function_of
from dsc.trees.blackboard import Board
from dsc.trees.building import build_tree
from dsc.trees.model import Node
from dsc.trees.running.leaves import ActionLeaf, ConditionLeaf
from dsc.trees.running.node import COMPLETE, Run, RunningNode, Status
from dsc.trees.running.ports import key_of, read_port
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.user_objects import shown

PERIOD = 0.1
"""Seconds between two ticks."""
MAX_WAKE_UPS = 100
"""Maximum number of ticks that follow each other without a pause, as nodes ask for them."""
_Body = TypeVar("_Body", bound=Callable[..., BoundTree])


def tree_skill(
    success: type[Outcome],
    failure: type[Outcome],
    *,
    reports: Iterable[type[Outcome]] = (),
    period: float = PERIOD,
    after_crash: AfterCrash = "sense",
) -> Callable[[_Body], _Body]:
    """Declare a method that returns a bound tree as a skill; each call runs the tree from its root.

    The annotations of parameters are their types, as for `skill`. The observation of an action is asserted when the
    action ends, regardless of the skill's outcome.

    Args:
        success: the outcome if the root of the tree succeeds, a class without attributes.
        failure: the outcome if the root of the tree fails or is skipped, a class without attributes.
        reports: the classes of the outcomes that actions report before the end.
        period: seconds of run time between two ticks; a timer of the tree shortens the pause.
        after_crash: as for `skill`; a repeated skill starts its tree again from the root.

    Raises:
        InputError: an outcome is not a class, or `success` or `failure` has attributes.
        SchemaError: an annotation has no valid type.
    """

    async def execute(_: Any, body: SkillBody, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
        bound = body(call, **arguments)
        if not isinstance(bound, BoundTree):
            raise InputError(f"a tree skill returns a tree from bind_tree(…), not {shown(bound)}")
        tree = RunningTree(bound, call.clock.now, call.observe)
        try:
            status = await tree.finish(call.clock.sleep, period)
        finally:
            await tree.halt()
        return Outcome((success if status is Status.SUCCESS else failure).event)

    return declare_tree((success, failure), reports, after_crash, execute)


class RunningTree:
    """A bound tree that is ticked.

    Args:
        bound: the tree.
        now: returns the seconds of run time.
        observe: receives the observations of actions.
    """

    def __init__(self, bound: BoundTree, now: Callable[[], float], observe: Callable[[Delta], None]) -> None:
        self.board = Board()
        for key, value in bound.entries.items():
            self.board.create(key).value = value
        self._bound = bound
        self._observe = observe
        self._run = Run(now, bound.enums)
        self._stopping: list[asyncio.Future[Outcome]] = []
        self._root = build_tree(bound.file, bound.name, self._run, self._make_leaf, self.board)

    def tick(self) -> Status:
        """Execute one tick, and return the status of the root."""
        self._run.woken = False
        status = self._root.execute()
        if status in COMPLETE:
            self._root.status = Status.IDLE
        return status

    async def finish(self, sleep: Callable[[float], Awaitable[None]], period: float) -> Status:
        """Tick the tree until its root is no longer running; return the status of the root."""
        wake_ups = 0
        while (status := self.tick()) is Status.RUNNING:
            wake_ups = wake_ups + 1 if self._run.woken and wake_ups < MAX_WAKE_UPS else 0
            await sleep(0 if wake_ups else self._pause(period))
        return status

    async def halt(self) -> None:
        """Halt the tree: cancel the running actions, and wait until they have stopped."""
        if self._root.status is Status.RUNNING:
            self._root.halt_node()
        if self._stopping:
            await asyncio.gather(*self._stopping, return_exceptions=True)

    def _pause(self, period: float) -> float:
        """Return the seconds until the next tick."""
        now = self._run.now()
        return min([period, *(due - now for due in self._run.due.values() if due > now)])

    def _make_leaf(self, node: Node, board: Board, run: Run) -> RunningNode:
        leaf = bind_leaf(self._bound, node)
        if isinstance(leaf.leaf, Action):
            return ActionLeaf(node, board, run, _ActionBody(leaf, node, board, self._observe, self._stopping))
        return ConditionLeaf(node, board, run, _ConditionBody(leaf, node, board))


class _LeafBody:
    """Base of the bodies of bound leaves: the values of their input ports."""

    def __init__(self, leaf: BoundLeaf, node: Node, board: Board) -> None:
        self.leaf, self.node, self.board = leaf, node, board
        self.function: Callable[..., Any] = function_of(leaf.leaf)
        self.ends = leaf.leaf.ends if isinstance(leaf.leaf, Action) else ()

    def arguments(self) -> dict[str, object]:
        """Return the values of the input ports, converted."""
        return {
            name: convert_port(self.node, name, read_port(self.node, name, text, self.board), self.leaf.converters)
            for name, text in self.leaf.inputs.items()
        }

    def stop(self) -> None:
        """Do nothing: a condition is never running."""


class _ConditionBody(_LeafBody):
    def start(self) -> Status:
        return Status.SUCCESS if self.function(**self.arguments()) else Status.FAILURE

    resume = start


class _ActionBody(_LeafBody):
    def __init__(
        self,
        leaf: BoundLeaf,
        node: Node,
        board: Board,
        observe: Callable[[Delta], None],
        stopping: list[asyncio.Future[Outcome]],
    ) -> None:
        super().__init__(leaf, node, board)
        self._observe = observe
        self._stopping = stopping
        self._task: asyncio.Future[Outcome] | None = None

    def start(self) -> Status:
        """Begin the coroutine, whose arguments are the values of the ports at this tick."""
        begin = partial(self.function, **self.arguments())
        self._task = asyncio.ensure_future(execute_action(self.node.title, begin, self._observe))
        return Status.RUNNING

    def resume(self) -> Status:
        """Return the status of the coroutine; after its end, write the output ports."""
        if self._task is None or not self._task.done():
            return Status.RUNNING
        outcome = self._task.result()
        succeeded = outcome.event in self.ends
        self._write(outcome, whole=succeeded)
        return Status.SUCCESS if succeeded else Status.FAILURE

    def _write(self, outcome: Outcome, *, whole: bool) -> None:
        for name, text in self.leaf.outputs.items():
            key = key_of(name, text)
            if key is not None and name in outcome.attributes:
                self.board.create(key).value = outcome.attributes[name]
            elif whole:
                message = f"{self.node.element}: the outcome '{outcome.event}' has no attribute for the port '{name}'"
                raise InputError(message, place=self.node.place, found=name, valid=outcome.attributes)

    def stop(self) -> None:
        """Cancel the coroutine."""
        if self._task is not None and not self._task.done():
            self._task.cancel()
            self._stopping.append(self._task)
