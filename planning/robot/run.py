"""Runs: the handle of a plot or goal that a robot runs inside an event loop."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine, Generator, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Self

from dsc.calls import Outputs
from dsc.components.component import Component
from dsc.engine.plot_changes import ActivePlots
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.sequencer.run_end import RunEnd
from dsc.sequencer.sequencer import Sequencer
from dsc.trace import Listener, Record
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from planning.execution.planning_component import PlanningComponent
from planning.robot.bundles import Bundle, components_of


@dataclass(frozen=True, slots=True)
class Waiting:
    """A skill for whose outcome a run waits.

    Attributes:
        skill: the skill, as `component.skill`.
        action_id: the id of the execution.
        since: second of run time at which the skill was started.
        waits_for: the component or skill that this skill waits for before it begins; empty if it is executing.
    """

    skill: str
    action_id: str
    since: float
    waits_for: str = ""


@dataclass(frozen=True, slots=True)
class RunState:
    """The state of a run at one moment.

    Attributes:
        time: second of run time.
        active: the paths of the active states.
        plans: the remaining steps of each plan in execution, by its goal.
        waiting: the running skills, and those that wait for a component.
        over: whether the run has ended.
    """

    time: float
    active: tuple[str, ...]
    plans: Mapping[str, tuple[str, ...]]
    waiting: tuple[Waiting, ...]
    over: bool


class Run(Generic[Outputs]):
    """A run of a robot, returned by `Robot.start`; `await` returns its end.

    Its methods may be called from any thread, apart from `records`, which belongs to the loop.

    Args:
        id: identifies the run.
        sequencer: the sequencer of the run.
        planning: the planning component of the run.
        main: the coroutine that runs it.

    Attributes:
        id: identifies the run: unique in real time; in simulated time, the number of the run of its robot.
        task: the task that runs it; its cancellation suspends a run with a store, and ends another.
    """

    def __init__(
        self,
        id: str,  # noqa: A002  the name of the field of the kept header, too
        sequencer: Sequencer,
        planning: PlanningComponent,
        main: Coroutine[Any, Any, RunEnd[Outputs]],
    ) -> None:
        self.id = id
        self._sequencer = sequencer
        self._planning = planning
        self.task = asyncio.get_running_loop().create_task(main, name=f"run {id}")

    def __await__(self) -> Generator[Any, None, RunEnd[Outputs]]:
        """Wait for the end of the run, and return the end; errors as for `Robot.run`."""
        return self.task.__await__()

    @property
    def state(self) -> RunState:
        """The present state: active states, plans, and the skills that the run waits for."""
        sequencer = self._sequencer
        return RunState(
            time=sequencer.clock.now(),
            active=tuple(sequencer.machine.state.configuration()),
            plans=self._planning.plans(),
            waiting=tuple(
                Waiting(f"{one.start.component}.{one.start.skill}", one.start.action_id, one.since, waits_for)
                for one, waits_for in sequencer.dispatcher.running()
            ),
            over=self.task.done(),
        )

    def post(self, event: Event | str, attributes: Mapping[str, Any] | None = None, *, after: float = 0.0) -> None:
        """Post an event from outside, or one with this name and these attributes; errors as for `Sequencer.post`."""
        said = Event(event, attributes or {}) if isinstance(event, str) else event
        self._sequencer.post(said, after=after)

    def change(self, delta: Delta, author: str, *, after: float = 0.0) -> None:
        """Post a change of knowledge by an author; errors as for `Sequencer.change`."""
        self._sequencer.change(delta, author, after=after)

    def set_parameter(self, owner: str, name: str, value: object, *, after: float = 0.0) -> None:
        """Post an operator's setting of a parameter; errors as for `Sequencer.set_parameter`."""
        self._sequencer.set_parameter(owner, name, value, after=after)

    def wire(self, port: str, to: str | None, *, after: float = 0.0) -> None:
        """Wire a required port to another provider; errors as for `Sequencer.wire`."""
        self._sequencer.wire(port, to, after=after)

    def install(
        self, plots: Bundle | ActionPlot | Iterable[ActionPlot] = (), components: Iterable[Component] = ()
    ) -> None:
        """Install plots and components, or those of a bundle, in the run; errors as for `Sequencer.install`.

        Of a bundle, the components whose names are already deployed are omitted.
        """
        if isinstance(plots, Bundle):
            deployed = self._sequencer.dispatcher.components
            own = [one for one in components_of([plots]) if one.name not in deployed]
            self._sequencer.install(plots.plots, [*own, *components])
        else:
            self._sequencer.install(plots, components)

    def replace(self, plots: ActionPlot | Iterable[ActionPlot], *, active: ActivePlots = "at_next_entry") -> None:
        """Replace plots of the run; errors as for `Sequencer.replace`."""
        self._sequencer.replace(plots, active=active)

    def remove(self, *names: str) -> None:
        """Remove plots from the run; errors as for `Sequencer.remove`."""
        self._sequencer.remove(*names)

    def cancel(self, reason: str) -> Self:
        """End the run after its exit actions; its end has the reason as its problem. `await` the returned run."""
        self._sequencer.stop(reason)
        return self

    def suspend(self) -> Self:
        """Stop the components, so that `Robot.resume_or_start` can resume the run. `await` the returned run.

        Raises:
            StoreError: the robot has no store.
        """
        self._sequencer.suspend()
        return self

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with every later record of this run; return a function that ends this."""
        return self._sequencer.trace.listen(listener)

    def ignore(self, listener: Listener) -> None:
        """Call `listener` no longer."""
        self._sequencer.trace.ignore(listener)

    def records(self) -> Records:
        """Return an asynchronous iterator of the records from this call on, which ends with the run."""
        return Records(self)


class Records:
    """An asynchronous iterator of the records of a run; unread records are kept."""

    def __init__(self, run: Run[Any]) -> None:
        self._records: asyncio.Queue[Record | None] = asyncio.Queue()
        self._ignore = run.listen(self._records.put_nowait)
        run.task.add_done_callback(lambda _: self._records.put_nowait(None))

    def __aiter__(self) -> Self:
        """Return the iterator."""
        return self

    async def __anext__(self) -> Record:
        """Return the next record; raise `StopAsyncIteration` after the last one."""
        record = await self._records.get()
        if record is None:
            self._records.put_nowait(None)  # for another reader of this iterator
            self._ignore()
            raise StopAsyncIteration
        return record


def require_loop(method: str, instead: str) -> None:
    """Raise `InputError` unless an event loop is running in this thread; `instead` needs none."""
    if _loop_is_running():
        return
    message = f"no event loop is running in this thread: call `robot.{instead}(...)` instead of `{method}`"
    if threading.current_thread() is not threading.main_thread():
        message += (
            ", or if the robot has a loop in another thread, `robot.goals.put` or `asyncio.run_coroutine_threadsafe`"
        )
    raise InputError(message)


def require_no_loop(method: str, instead: str) -> None:
    """Raise `InputError` if an event loop is running in this thread; `instead` is the method to await."""
    if _loop_is_running():
        message = f"`robot.{method}` cannot wait inside a running event loop (a notebook, a web handler, an async test)"
        raise InputError(f"{message}: `await robot.{instead}(...)`")


def _loop_is_running() -> bool:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True
