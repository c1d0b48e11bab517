"""A robot, deployed: a program that runs plots and achieves goals, and reports on its task."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Coroutine, Iterable, Mapping
from functools import partial
from typing import Any, Self, cast
from uuid import uuid4

from pydantic import ValidationError

from dsc.calls import Outputs, PlotCall
from dsc.dynamic.knowledge_situation import ACHIEVE
from dsc.model.states import Budget
from dsc.run_log import logged_run
from dsc.runs.archive import RunRow, is_unfinished
from dsc.runs.kept import Kept
from dsc.runs.store import RunStore
from dsc.sequencer.clock import ClockKind, LoopClock, run_real, run_simulated
from dsc.sequencer.run_end import RunEnd
from dsc.sequencer.sequencer import Sequencer
from dsc.sequencer.signals import OnSignal
from knowledge_base.errors import InputError, StoreError
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.user_objects import shown
from planning.execution.planning_component import PlanningComponent
from planning.problem.construction import check_goal
from planning.robot.judgement import Judgement
from planning.robot.observations import record_observations
from planning.robot.program import RobotProgram
from planning.robot.report import Report
from planning.robot.run import Run, require_loop, require_no_loop
from planning.robot.serving import serve_goals
from planning.robot.simulation import SceneWriter, scene_of
from planning.robot.tally import Tally
from planning.robot.task import Task

Prepare = Callable[[Sequencer], object]
"""Callback that is called before a run starts, e.g. to post events or to keep a reference to the sequencer."""
_BUDGET = Budget()
LONGEST_RUN = 604_800.0
"""Seconds of simulated time, one week, after which a run ends with a problem unless `until` is given.

In real time, and for an open-ended run, there is no default limit.
"""


class Robot(RobotProgram):
    """A robot that can run plots and achieve goals. `deploy` makes one from a `Bundle`.

    Args:
        domain: the planning domain, or its PDDL file. Components may add fragments. The schema of the knowledge base
            must declare the merged domain.
        plots: the plots; plots with `implements` execute planning actions. Several robots may share one `Library`
            and its caches. The plot `achieve` is added if the library lacks it.
        components: the components, with their skills.
        knowledge: the knowledge base, whose schema the plots may use; by default an empty one with the domain's schema.
        planner: the planner. The default in simulated time is pyperplan, or an installed deterministic engine for
            problems that pyperplan cannot solve, so that a run is repeatable. The default in
            real time is a race of the engines that suit a problem.
        clock: "real", or "simulated" time that jumps from event to event. Without it, the event loop of `start`
            determines the kind; `run`, `achieve`, `resume` and `report` then raise an error.
        parallel: whether independent steps of a plan are executed concurrently.
        foresight: simulates each plan before its execution.
        store: a file for the knowledge base and the runs, so that a run can be resumed after a crash. A missing file is
            created. With a store, the argument `knowledge` must be omitted.
        durability: with a store, "process" survives a crash of the process, and "power" also a power failure.
        failures: further outcomes with which a plot does not reach its goal, see `failures`.
        origin: the deployed bundle; `None` for a robot that was not made by `deploy`.
        conversions: the functions that terms of the plots may call; a `Library` has its own.
        wiring: the providers of required ports, both as `component.port`, see `dsc.components.wiring`.
        resources: the capacity of each resource that components demand, see `dsc.supervision.room`; without it, all
            components may be active together.
        experience: the tries for learned choices, see `dsc.dynamic.experience`.

    Attributes:
        clock: the kind of time; `None` for that of the event loop.
        components: the components.
        domain: the merged planning domain.
        experience: the tries for the learned choices of later runs.
        library: the plots.
        knowledge: the knowledge base.
        store: the file of knowledge and runs; `None` without a store.
        origin: the deployed bundle; `None` without a bundle.

    Raises:
        PlotError: a plot does not pass the validator; the error contains all findings.
        InputError: a domain file contains an error, two fragments contradict each other, or two plots have equal
            names. A component's parameter lacks a value, or a relation between parameters is violated. Both
            `knowledge` and `store` are given.
        SchemaMismatchError: the schema of `knowledge` lacks declarations of the domain.
        StoreError: the store cannot be opened, or another process has opened it for writing.
    """

    def run(
        self,
        plot: str | PlotCall[Outputs],
        arguments: Mapping[str, Any] | None = None,
        *,
        speed: float = math.inf,
        open_ended: bool = False,
        until: float | None = None,
        prepare: Prepare | None = None,
        header: Mapping[str, Any] | None = None,
    ) -> RunEnd[Outputs]:
        """Run a plot to its end, and return how the run ended.

        Args:
            plot: the name of the plot, or a call with its arguments, see `dsc plot types`.
            arguments: values of the plot's parameters.
            speed: simulated seconds per real second, for people who watch a run in simulated time.
            open_ended: whether an idle run waits for events from outside, e.g. from an operator. Otherwise an idle run
                ends and reports the deadlock.
            until: second of run time at which a run that has not ended ends with a problem. The default is
                `LONGEST_RUN` in simulated time unless the run is open-ended, and no limit otherwise.
            prepare: called before the run starts, see `Prepare`.
            header: plain data that the store keeps with the run.

        Raises:
            InputError: the plot is unknown, or a parameter is missing or unknown. An event loop is running. The robot
                has no `clock`, is closed, or runs already with its store.
            StoreError: the store cannot be written, or contains an unfinished run.
        """
        require_no_loop("run", "start")
        self._require_free()

        async def main() -> RunEnd[Outputs]:
            return await self.start(plot, arguments, open_ended=open_ended, until=until, prepare=prepare, header=header)

        return _complete(main, self._required_clock(), speed=speed)

    def start(
        self,
        goal_or_plot: str | PlotCall[Outputs],
        arguments: Mapping[str, Any] | None = None,
        *,
        seconds: float = _BUDGET.seconds,
        replans: int = _BUDGET.replans,
        open_ended: bool = False,
        until: float | None = None,
        prepare: Prepare | None = None,
        header: Mapping[str, Any] | None = None,
    ) -> Run[Outputs]:
        """Start a goal or a plot in the running event loop, and return the run; `await` it for its end.

        The loop determines whether time is real, or simulated by `run_simulated`; a robot with a `clock` requires that
        kind.

        Args:
            goal_or_plot: a goal, which begins with `(`, or the name or call of a plot.
            arguments: values of the plot's parameters.
            seconds: real time for each search for the goal.
            replans: the maximum number of plans for the goal after the first plan.
            open_ended: see `run`.
            until: see `run`.
            prepare: see `run`.
            header: see `run`.

        Raises:
            InputError: no event loop is running, or one with another kind of time than the robot's `clock`. The robot
                is closed, or runs already with its store. Further errors as for `run` and `achieve`.
        """
        require_loop("start", "run")
        if isinstance(goal_or_plot, str) and goal_or_plot.lstrip().startswith("("):
            arguments, goal_or_plot = self._goal(goal_or_plot, seconds, replans), ACHIEVE
        self._require_free()
        self.library.plot(goal_or_plot if isinstance(goal_or_plot, str) else goal_or_plot.plot)
        clock = self._loop_clock()
        limit = _limit(until, bounded=clock.simulated and not open_ended)
        number = self._new_id(simulated=clock.simulated)
        how = {"id": number, "simulated": clock.simulated, "open_ended": open_ended, "until": limit}
        if not clock.simulated:
            how["action_ids"] = number
        store = self.run_store({**(header or {}), **how})
        sequencer, planning = self.wire(number, clock, 0, store, open_ended=open_ended, until=limit)
        if prepare is not None:
            prepare(sequencer)
        return self._begin(number, sequencer, planning, sequencer.run(goal_or_plot, arguments))

    async def achieving(
        self, goal: str, *, seconds: float = _BUDGET.seconds, replans: int = _BUDGET.replans, until: float | None = None
    ) -> RunEnd:
        """Plan for a goal and execute the plan inside the running event loop; see `achieve`."""
        return await self.start(goal, seconds=seconds, replans=replans, until=until)

    def resume(self, *, speed: float = math.inf, prepare: Prepare | None = None) -> RunEnd:
        """Resume the unfinished run of the store at its last macrostep, and run it to its end; for `speed` see `run`.

        Listeners receive the records of the run from the beginning. `prepare` is called again. Scheduled events that
        are still pending are kept and need not be posted again.

        Raises:
            InputError: an event loop is running, the robot is closed, or its `clock` is not that of the run.
            StoreError: there is no store or no unfinished run, or the store cannot be read or written.
            ChangedError: plots or domain differ from their versions at the start of the run; the message lists the
                differences.
        """
        require_no_loop("resume", "resuming")
        store, kept = self._open_unfinished()

        async def main() -> RunEnd:
            return await self._resume(store, kept, prepare)

        return _complete(main, kind_of(kept.run), kept.time, speed)

    def resuming(self, *, prepare: Prepare | None = None) -> Run:
        """Resume the unfinished run of the store in the running event loop, and return the run; see `resume`.

        Raises:
            InputError: the run uses simulated time and the loop real time, or the run uses real time and the loop
                simulated time.
        """
        require_loop("resuming", "resume")
        store, kept = self._open_unfinished()
        _require_kind(kept, self._loop_clock().kind)
        return self._resume(store, kept, prepare)

    def resume_or_start(
        self, goal_or_plot: str | PlotCall[Outputs], arguments: Mapping[str, Any] | None = None, **how: Any
    ) -> Run[Outputs]:
        """Resume the unfinished run of the store in the running event loop; without one, start a goal or plot.

        Raises:
            StoreError: there is no store, or it cannot be read or written. Further errors as for `start` and
                `resuming`.
        """
        if self.store is None:
            raise StoreError("only a run with a store can be resumed: give the robot a store, or call `start`")
        if is_unfinished(self.store):
            return cast("Run[Outputs]", self.resuming(prepare=how.get("prepare")))
        return self.start(goal_or_plot, arguments, **how)

    @property
    def runs(self) -> tuple[Run[Any], ...]:
        """The runs in progress, the oldest first."""
        return tuple(self._runs)

    async def serve(
        self, *, seconds: float = _BUDGET.seconds, replans: int = _BUDGET.replans, until_empty: bool = False
    ) -> None:
        """Serve the queue of goals one after the other; first resume the goal that an interruption has left.

        A goal that cannot be planned for, or whose deadline passes, fails with the reason, and the next goal follows.

        Args:
            seconds: real time for each search.
            replans: the maximum number of plans for a goal after the first plan.
            until_empty: whether to return when no goal waits. Otherwise the robot waits for goals until the caller
                cancels this coroutine, suspends the run of a goal, or closes the robot.

        Raises:
            InputError: the robot is closed, or runs already with its store.
            StoreError: the store cannot be read or written, or has an unfinished run that serves no goal.
            ChangedError: as for `resume`.
        """
        await serve_goals(self, until_empty=until_empty, seconds=seconds, replans=replans)

    def discard(self, reason: str = "discarded") -> None:
        """End the unfinished run of the store, so that another run can start; its kept end has the reason.

        Raises:
            InputError: the run is in progress in this robot, or the robot is closed.
            StoreError: there is no store or no unfinished run, or the store cannot be written.
        """
        self._require_free()
        store = self.run_store({})
        if store is None:
            raise StoreError("only a run with a store can be discarded")
        store.discard(reason)

    def achieve(
        self,
        goal: str,
        *,
        seconds: float = _BUDGET.seconds,
        replans: int = _BUDGET.replans,
        speed: float = math.inf,
        open_ended: bool = False,
        until: float | None = None,
        prepare: Prepare | None = None,
        header: Mapping[str, Any] | None = None,
    ) -> RunEnd:
        """Plan for a goal, execute the plan, and replan if a change of the world breaks the plan.

        The returned end is `finished`, and contains whether the goal was `reached`. If the goal was not reached, the
        end contains the event `no_plan` or `gave_up`, with the reason.

        Args:
            goal: the condition to reach.
            seconds: real time for each search.
            replans: the maximum number of plans after the first plan.
            speed: see `run`.
            open_ended: see `run`.
            until: see `run`.
            prepare: see `run`.
            header: see `run`.

        Raises:
            InputError: the goal is not a condition or contains an undeclared name, or a limit is out of range.
        """
        require_no_loop("achieve", "achieving")
        return self.run(
            ACHIEVE,
            self._goal(goal, seconds, replans),
            speed=speed,
            open_ended=open_ended,
            until=until,
            prepare=prepare,
            header=header,
        )

    def judgement(self, task: Task | None = None) -> Judgement:
        """Return the judgement of a task, by default the robot's own; raise `InputError` without a task."""
        task = task or (None if self.origin is None else self.origin.task)
        if task is None:
            raise InputError("a robot without a bundle has no task: name one, e.g. Task(goal=...)")
        bundle = None if self.origin is None else self.origin.bundle
        return Judgement(task, bundle, self.simulation, self.knowledge, self.domain)

    def report(
        self,
        task: Task | None = None,
        *,
        speed: float = math.inf,
        until: float | None = None,
        on_signal: OnSignal = "suspend",
        prepare: Prepare | None = None,
    ) -> Report:
        """Run a task and return the report, also if Ctrl-C, SIGTERM or SIGHUP ends the run.

        Args:
            task: the task; by default the robot's own. A robot that `planning.resume` returned resumes its kept run.
            speed: as for `run`.
            until: as for `run`; a resumed run keeps its limit.
            on_signal: with a store, `suspend` stops the components as at an end, and the run can be resumed; `end`
                ends the run.
            prepare: as for `run`.

        Raises:
            InputError: the robot has no `clock` or no task, or the goal or an argument does not fit the robot.
            StoreError: the store cannot be read or written.
            ChangedError: plots or domain differ from their versions at the start of the resumed run.
        """
        clock, judgement, tally, started = self._required_clock(), self.judgement(task), Tally(), time.perf_counter()

        def ready(sequencer: Sequencer) -> None:
            sequencer.on_signal = on_signal
            if self.simulation is not None and scene_of(self.simulation) is not None:
                sequencer.trace.listen(SceneWriter(self.simulation, sequencer.trace))
            if prepare is not None:
                prepare(sequencer)

        ignore = self.listen(tally)
        try:
            end = self._perform(judgement.task, ready, speed=speed, until=until)
        except KeyboardInterrupt as interrupt:
            suspended = self.store is not None and on_signal == "suspend"
            end = RunEnd(finished=False, problem=_describe_interruption(*interrupt.args, suspended=suspended))
        finally:
            ignore()
        return judgement.report(self.name, end, tally, self.failures, time.perf_counter() - started, clock)

    def _perform(self, task: Task, prepare: Prepare, *, speed: float, until: float | None) -> RunEnd:
        if self.origin is not None and self.origin.resumes:
            return self.resume(speed=speed, prepare=prepare)
        header = {**self.header(), **({} if self.origin is None else self.origin.kept)}
        if task.plot is not None:
            return self.run(task.plot, task.arguments, speed=speed, until=until, prepare=prepare, header=header)
        if task.goal is None:
            raise InputError("a task is a plot or a goal: Task(plot=...) or Task(goal=...)")
        return self.achieve(task.goal, speed=speed, until=until, prepare=prepare, header=header)

    def _goal(self, goal: str, seconds: float, replans: int) -> dict[str, Any]:
        """Return the arguments of the plot `achieve` for a goal."""
        check_goal(parse_condition(goal, "goal"), self.knowledge)
        budget = _budget(seconds, replans)
        return {"goal": goal, "holder": "", "replans": budget.replans, "seconds": budget.seconds}

    def _new_id(self, *, simulated: bool) -> str:
        self._started += 1
        return str(self._started) if simulated else uuid4().hex

    def _require_free(self) -> None:
        """Raise `InputError` if the robot is closed, or runs already with its store."""
        if self._closed:
            raise InputError("the robot is closed; it starts no further run")
        if self.store is not None and self._runs:
            raise InputError(f"the robot already has a run in '{self.store.name}': await or suspend it first")

    def _open_unfinished(self) -> tuple[RunStore, Kept]:
        self._require_free()
        store = self.run_store({})
        if store is None:
            raise StoreError("only a run with a store can be resumed")
        kept = store.load_unfinished(self.library)
        if self.clock is not None:
            _require_kind(kept, self.clock)
        return store, kept

    def _required_clock(self) -> ClockKind:
        if self.clock is None:
            raise InputError('the robot needs a kind of time: clock="real" for devices, or clock="simulated" for tests')
        return self.clock

    def _loop_clock(self) -> LoopClock:
        """Return a clock of the running event loop, whose kind of time must be that of the robot."""
        clock = LoopClock()
        if self.clock not in (None, clock.kind):
            raise InputError(f'the time of the event loop is {clock.kind}, and the robot has clock="{self.clock}"')
        return clock

    def _resume(self, store: RunStore, kept: Kept, prepare: Prepare | None) -> Run:
        for record in kept.records:
            for listener in self._listeners:
                listener(record)
        clock = LoopClock(kept.time)
        open_ended, until = bool(kept.run.header["open_ended"]), kept.run.header["until"]
        number = str(kept.run.header.get("id", kept.run.number))
        sequencer, planning = self.wire(number, clock, kept.last_record, store, open_ended=open_ended, until=until)
        if prepare is not None:
            prepare(sequencer)
        return self._begin(number, sequencer, planning, sequencer.resume(kept))

    def _begin(
        self, number: str, sequencer: Sequencer, planning: PlanningComponent,
        main: Coroutine[Any, Any, RunEnd[Outputs]],
    ) -> Run[Outputs]:  # fmt: skip
        observers = [partial(record_observations, profile, sequencer) for profile in self._monitored]
        run = Run(number, sequencer, planning, _closing(main, planning, (self.name, number), observers))
        self._runs[run] = None
        run.task.add_done_callback(lambda _: self._runs.pop(run))
        return run

    async def aclose(self) -> None:
        """Suspend the runs in progress, or end them without a store; then close the robot, see `close`."""
        self._end_queue()
        for run in [*self._runs]:
            if self.store is None:
                run.cancel("the robot is closed")
            else:
                run.suspend()
        if self._runs:
            await asyncio.wait([run.task for run in self._runs])
        self.close()

    def close(self) -> None:
        """Close the store and the simulated world, and terminate the processes of the default planners.

        Later calls that start a run raise `InputError`. Runs in progress are cancelled, which suspends a run with a
        store; `async with` or `aclose` waits for them.
        """
        self._end_queue()
        if self._runs:
            for run in self._runs:
                run.task.cancel()
                run.task.add_done_callback(self._release_after)
        else:
            self.release()

    def _end_queue(self) -> None:
        self._closed = True
        if "goals" in vars(self):
            self.goals.close()

    def _release_after(self, _: object) -> None:
        if not self._runs:
            self.release()

    async def __aenter__(self) -> Self:
        """Return the robot; the end of the `async with` block calls `aclose`."""
        return self

    async def __aexit__(self, *_: object) -> None:
        """Close the robot, see `aclose`."""
        await self.aclose()

    def __enter__(self) -> Self:
        """Return the robot; the end of the `with` block calls `close`."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the robot, see `close`."""
        self.close()


def _complete(
    main: Callable[[], Coroutine[Any, Any, RunEnd[Outputs]]], kind: ClockKind, at: float = 0.0, speed: float = math.inf
) -> RunEnd[Outputs]:
    """Run a coroutine to its end in an event loop with this kind of time."""
    if kind == "simulated":
        return run_simulated(main(), at, speed)
    if speed != math.inf:
        raise InputError(f"a speed of {speed:g} needs simulated time")
    return run_real(main())


def kind_of(run: RunRow) -> ClockKind:
    """Return the kind of time of a kept run."""
    return "simulated" if run.header["simulated"] else "real"


def _require_kind(kept: Kept, kind: ClockKind) -> None:
    began = kind_of(kept.run)
    if kind != began:
        raise InputError(f"the run was begun in {began} time and cannot be resumed in {kind} time")


async def _closing(
    running: Coroutine[Any, Any, RunEnd[Outputs]],
    planning: PlanningComponent,
    logged: tuple[str, str],
    observers: Iterable[Callable[[], Coroutine[Any, Any, None]]],
) -> RunEnd[Outputs]:
    logged_run.set(logged)  # in the task of the run
    observing = [asyncio.ensure_future(observe()) for observe in observers]
    try:
        return await running
    finally:
        for one in observing:
            one.cancel()
        await planning.over()


def _limit(until: float | None, *, bounded: bool) -> float | None:
    """Return the second at which a run ends at the latest; `None` without a limit."""
    if until is None:
        return LONGEST_RUN if bounded else None
    if isinstance(until, bool) or not isinstance(until, int | float) or not until > 0:
        raise InputError(f"`until` is a positive number of seconds, not {shown(until)}")
    return None if until == math.inf else until


def _budget(seconds: float, replans: int) -> Budget:
    try:
        return Budget(seconds=seconds, replans=replans)
    except ValidationError as error:
        first = error.errors()[0]
        wrong = f"'{first['loc'][0]}' is {first['input']!r}: {first['msg']}"
        raise InputError(wrong, found=str(first["input"])) from None


def _describe_interruption(name: str = "SIGINT", *, suspended: bool) -> str:
    """Return how a run ended at the signal of that name."""
    who = "the operator" if name == "SIGINT" else name
    return f"{who} suspended the run, which can be resumed" if suspended else f"{who} ended the run"
