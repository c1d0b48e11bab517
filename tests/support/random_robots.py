"""Random small robots in a world that others change: domains, plots, rules, handlers, priorities, faults and kills.

`RandomRobot(seed)` draws everything from its seed. `Trial(robot).wrong` lists the broken promises of one run, which is
also killed and resumed. As a command, with `--runs` and `--first`: exit status 1 if a promise is broken.
"""

from __future__ import annotations

import argparse
import logging
import multiprocessing
import os
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from random import Random
from typing import Annotated, Any

sys.path.insert(0, str(Path(__file__).parent))
from breadth_first import BreadthFirst
from dsc_crashes import copied

from dsc import Component, Event, Outcome, SkillCall, SkillError, parse_plot, replay, skill
from dsc.chance import choose, uniform
from dsc.errors import PlotError
from dsc.runs.archive import archive
from dsc.trace import Record
from knowledge_base import Delta, KnowledgeBase, StoreError, fact
from knowledge_base.language.evaluation.evaluator import holds
from planning import PlanningDomain, PlanStep, Robot

UNARY, NULLARY = ("p0", "p1", "p2"), ("q0", "q1")
COMPONENTS = ("arm", "hand", "leg")
"""The leg is concurrent; the arm and the hand execute one skill at a time."""
SECONDS = (1.0, 2.0, 3.5, 7.0)
KINDS = ("jam", "jam", "partial", "error", "late", "side")
LIMIT = 20_000.0
Thing = Annotated[str, "thing"]


class Did(Outcome): ...


class Jam(Outcome):
    x: Thing


@dataclass
class World:
    """The devices of a robot, which outlast its program: what each action did, and what runs now.

    Attributes:
        ended: outcome, attributes and observation of each action that was carried out, by action id.
        running: the ids of the actions that run now, by component.
        wrong: what a device must never be told to do.
    """

    ended: dict[str, Any] = field(default_factory=dict)
    running: dict[str, list[str]] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)

    def after_a_kill(self) -> World:
        """The devices as the next program finds them."""
        return World(dict(self.ended))


class Device(Component):
    """Carries out the planning actions that its robot assigns to it."""

    def __init__(self, name: str, robot: RandomRobot, world: World) -> None:
        super().__init__(name)
        self.concurrent = name == "leg"
        self.robot, self.world = robot, world
        self.knowledge: Any = None

    @skill(after_crash="same_id")
    async def act(self, call: SkillCall, action: str, x: Thing) -> Did | Jam:
        """One planning action; an id that was carried out before has the same end."""
        with _running(self, call.action_id):
            known = self.world.ended.get(call.action_id)
            robot, step = self.robot, PlanStep(action, (x,))
            fault = uniform(robot.seed, call.action_id, "fault") < robot.faults
            kind = choose(robot.seed, call.action_id, "kind", KINDS) if fault else "done"
            await call.clock.sleep(robot.seconds[action] + (100 if kind == "late" else 0))
            if known is None:
                known = self.world.ended[call.action_id] = self._carried_out(step, kind, call.action_id)
            if known == "error":
                raise SkillError("the device does not answer")
            event, observed = known
            return Jam(x=x) if event == "jam" else Did(observed=observed)

    @skill(after_crash="same_id")
    async def aid(self, call: SkillCall) -> Did:
        """A short action without an effect."""
        with _running(self, call.action_id):
            await call.clock.sleep(1.5)
            return Did()

    def _carried_out(self, step: PlanStep, kind: str, action_id: str) -> Any:
        if kind in ("error", "jam"):
            return "error" if kind == "error" else ("jam", Delta())
        effect = self.robot.domain.effects(step, self.knowledge)
        if kind == "partial":
            effect = Delta(added=effect.added[:1], removed=() if effect.added else effect.removed[:1])
        if kind == "side":
            what = fact(choose(self.robot.seed, action_id, "which", UNARY), step.args[0])
            if what not in (*effect.added, *effect.removed):
                there = what in self.knowledge.facts()
                more: dict[str, Any] = (
                    {"removed": (*effect.removed, what)} if there else {"added": (*effect.added, what)}
                )
                effect = replace(effect, **more)
        return "done", effect


class _running:  # noqa: N801  # a context manager
    def __init__(self, device: Device, action_id: str) -> None:
        self._device, self._id = device, action_id

    def __enter__(self) -> None:
        running = self._device.world.running.setdefault(self._device.name, [])
        if running and not self._device.concurrent:
            self._device.world.wrong.append(f"{self._device.name} does {running} and {self._id} at once")
        running.append(self._id)

    def __exit__(self, *_: object) -> None:
        self._device.world.running[self._device.name].remove(self._id)


class RandomRobot:
    """A robot that its seed determines: domain, plots, initial facts, changes by others, events and faults."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.draw = Random(seed)
        self.things = [f"o{n}" for n in range(self.draw.randint(1, 3))]
        self.faults = self.draw.choice((0.0, 0.1, 0.3, 0.5))
        self.parallel = self.draw.random() < 0.8
        self.actions = [f"a{n}" for n in range(self.draw.randint(3, 5))]
        self.seconds = {action: self.draw.choice(SECONDS) for action in self.actions}
        self.component = {action: self.draw.choice(COMPONENTS) for action in self.actions}
        self.text = self._domain()
        self.domain = PlanningDomain.parse(self.text)
        self.facts = [one for one in self._facts() if self.draw.random() < 0.4]
        self.gained = self._gained()
        self.plots = [text for action in self.actions for text in self._implementations(action)] + self._helpers()
        self.replans = self.draw.choice((2, 8))
        self.goal = self._goal() if self.draw.random() < 0.4 else None
        self.events = self.draw.random() < 0.7
        self.plots.append(self._main())
        self.meanwhile = [self._change() for _ in range(self.draw.choice((0, 1, 3, 6, 12)))]

    # -- the domain ----------------------------------------------------------------------------------------

    def _literal(self, negative: float, thing: str = "?x") -> str:
        atom = f"({self.draw.choice(UNARY)} {thing})" if self.draw.random() < 0.7 else f"({self.draw.choice(NULLARY)})"
        return f"(not {atom})" if self.draw.random() < negative else atom

    def _domain(self) -> str:
        declared = " ".join([f"({name} ?x - thing)" for name in UNARY] + [f"({name})" for name in NULLARY])
        return (
            f"(define (domain d) (:types thing) (:predicates {declared}) {' '.join(map(self._action, self.actions))})"
        )

    def _action(self, name: str) -> str:
        needed = " ".join(self._literal(0.3) for _ in range(self.draw.choice((0, 1, 1, 2))))
        effects: dict[str, str] = {}
        for _ in range(self.draw.choice((1, 1, 2, 3))):
            effect = self._literal(0.3)
            effects[effect.removeprefix("(not ").rstrip(")")] = effect
        return f"(:action {name} :parameters (?x - thing) :precondition (and {needed}) :effect (and {' '.join(effects.values())}))"

    def _facts(self) -> list[Any]:
        return [fact(name, thing) for name in UNARY for thing in self.things] + [fact(name) for name in NULLARY]

    def _gained(self) -> list[str]:
        """Facts that a random sequence of actions brings about, so that many goals can be reached."""
        world = KnowledgeBase(self.domain.schema)
        world.apply(Delta(nodes=dict.fromkeys(self.things, "thing"), added=tuple(self.facts)), "test")
        before, gained = set(self.facts), dict[str, None]()
        for _ in range(40):
            step = PlanStep(self.draw.choice(self.actions), (self.draw.choice(self.things),))
            if self.domain.applicable(step, world):
                world.apply(self.domain.effects(step, world), "test")
                gained.update(dict.fromkeys(sorted(str(one) for one in set(world.facts()) - before)))
        return [*gained]

    def _goal(self) -> str:
        if self.draw.random() < 0.2:
            return f"(forall (?x - thing) ({self.draw.choice(UNARY)} ?x))"
        parts = [
            self.draw.choice(self.gained)
            if self.gained and self.draw.random() < 0.75
            else self._literal(0.25, self.draw.choice(self.things))
            for _ in range(self.draw.randint(1, 3))
        ]
        return f"(and {' '.join(parts)})"

    # -- the plots -----------------------------------------------------------------------------------------

    def _rank(self) -> str:
        return self.draw.choice(("", "", "", "priority: 1, ", "priority: -1, ", "priority: 2, preempt: true, "))

    def _implementations(self, action: str) -> list[str]:
        trigger = f"{{trigger: {self.component[action]}.act, with: {{action: {action}, x: ?x}}, within: {self.draw.choice((9, 20, 40))}}}"
        go = f"go: {{{self._rank()}entry: {trigger}, on: {{did: there, jam: {{to: stuck, emit: jam, with: {{x: ?event.x}}}}}}}}"
        head = f"implements: {action}\nparameters: {{x: thing}}\nemits: {{jam: {{x: thing}}}}\nconfirm: {self.draw.choice((0.5, 3))}\n"
        ends = "there: {final: true}, stuck: {final: true}"
        texts = [f"plot: {action}\n{head}states: {{{go}, {ends}}}"]
        if self.draw.random() < 0.25:
            first = "first: {entry: {trigger: leg.aid, within: 20}, on: {did: go}}"
            when = f"when: ({self.draw.choice(UNARY)} ?x)\n"
            texts.append(f"plot: {action}_alt\n{when}{head}states: {{{first}, {go}, {ends}}}")
        return texts

    def _helpers(self) -> list[str]:
        helper, told = self.draw.choice(COMPONENTS), self.draw.choice(UNARY)
        aid = f"{{trigger: {helper}.aid, within: 20}}"
        failed = "skill_error: c, timed_out: c"
        return [
            f"plot: fix\nparameters: {{x: thing}}\nemits: {{unfixed: }}\nstates: {{a: {{entry: {aid}, on: {{did:"
            f" {{to: b, tell: ({told} ?x)}}, {failed}}}}}, b: {{final: true}}, c: {{final: true, emit: unfixed}}}}",
            f"plot: react\nparameters: {{x: thing}}\nstates: {{a: {{entry: {aid}, on: {{did:"
            f" {{to: c, tell: (not ({told} ?x))}}, {failed}}}}}, c: {{final: true}}}}",
        ]

    def _main(self) -> str:
        many = self.draw.randint(1, 3)
        states = [self._state(number, f"s{number + 1}" if number + 1 < many else "over") for number in range(many)]
        lines = ["plot: main", "receives: {ping: {x: thing}}", "emits: {bad: }", "states:", *states]
        failing = "failed" in "".join(states)
        lines += ["  over: {final: true}", *(["  failed: {final: true, emit: bad}"] if failing else [])]
        return "\n".join([*lines, *self._rules(), *self._handlers()])

    def _state(self, number: int, following: str) -> str:
        after = (
            f"after: {{seconds: {self.draw.choice((5, 12, 30))}, to: {following}}}, "
            if self.draw.random() < 0.3
            else ""
        )
        budget = "budget: {replans: 2, seconds: 10}, " if self.draw.random() < 0.5 else ""
        if self.draw.random() < 0.5:
            on = f"{{done: {following}, no_plan: {self.draw.choice((following, 'failed'))}, gave_up: failed}}"
            return f"  s{number}: {{{self._rank()}{after}{budget}goal: {self._goal()}, on: {on}}}"
        regions = ", ".join(self._region(f"{number}{letter}") for letter in "uvw"[: self.draw.randint(2, 3)])
        return f"  s{number}: {{{after}regions: {{{regions}}}, on: {{done: {following}}}}}"

    def _region(self, mark: str) -> str:
        kind = self.draw.random()
        if kind < 0.6:
            inside = f"goal: {self._goal()}, on: {{done: e{mark}, no_plan: e{mark}, gave_up: e{mark}}}"
        elif kind < 0.8:
            inside = f"use: fix, with: {{x: {self.draw.choice(self.things)}}}, on: {{done: e{mark}, unfixed: e{mark}}}"
        else:
            trigger = f"{{trigger: {self.draw.choice(COMPONENTS)}.aid, within: 30}}"
            inside = f"entry: {trigger}, on: {{did: e{mark}, timed_out: e{mark}, skill_error: e{mark}}}"
        return f"r{mark}: {{states: {{g{mark}: {{{self._rank()}{inside}}}, e{mark}: {{final: true}}}}}}"

    def _rules(self) -> list[str]:
        rules = []
        if self.draw.random() < 0.6:
            then = self.draw.choice(("retry", "replan", "continue", "use"))
            limit = f", limit: {self.draw.randint(1, 3)}" if then == "retry" else ""
            do = f"{{then: {then}{limit}}}"
            if then == "use":
                on = f"on: {{unfixed: {self.draw.choice(('replan', 'retry'))}}}"
                do = f"{{use: fix, with: {{x: ?event.x}}, {on}, then: {self.draw.choice(('retry', 'replan', 'continue'))}}}"
            rules.append(f"  - {{on: jam, {self._rank()}do: {do}}}")
        if self.draw.random() < 0.3:
            rules.append(f"  - {{on: timed_out, do: {{then: {self.draw.choice(('retry', 'replan', 'give_up'))}}}}}")
        if self.draw.random() < 0.3:
            do = f"{{use: fix, with: {{x: ?step.x}}, on: {{unfixed: enter}}, then: {self.draw.choice(('enter', 'continue'))}}}"
            rules.append(
                f"  - {{before: {self.draw.choice(self.actions)}, when: ({self.draw.choice(UNARY)} ?step.x), do: {do}}}"
            )
        if self.draw.random() < 0.3:
            told = f"do: {{tell: ({self.draw.choice(NULLARY)})}}"
            rules.append(
                f"  - {{after: {self.draw.choice(self.actions)}, when: ({self.draw.choice(UNARY)} ?step.x), {told}}}"
            )
        return ["rules:", *rules] if rules else []

    def _handlers(self) -> list[str]:
        if not self.events:
            return []
        kind = self.draw.choice(("interrupt: true, ", "", self._rank()))
        return ["handlers:", f"  - {{on: ping, {kind}do: {{use: react, with: {{x: ?event.x}}}}}}"]

    # -- the run -------------------------------------------------------------------------------------------

    def _change(self) -> tuple[float, Any]:
        at = self.draw.choice((self.draw.uniform(0, 60), float(self.draw.randint(1, 40)), self.draw.randint(1, 80) / 2))
        if self.events and self.draw.random() < 0.4:
            return at, Event("ping", {"x": self.draw.choice(self.things)})
        what = self.draw.choice(self._facts())
        return at, Delta(added=(what,)) if self.draw.random() < 0.5 else Delta(removed=(what,))

    def program(self, world: World, store: Path) -> Robot:
        """The program of the robot, with its devices."""
        devices = [Device(name, self, world) for name in COMPONENTS]
        program = Robot(
            self.domain,
            map(parse_plot, self.plots),
            devices,
            planner=BreadthFirst(),
            parallel=self.parallel,
            store=store,
            clock="simulated",
        )
        for device in devices:
            device.knowledge = program.knowledge
        return program

    def prepare(self, sequencer: Any) -> None:
        """Schedule the changes by others, and the events."""
        for at, what in self.meanwhile:
            if isinstance(what, Delta):
                sequencer.change(what, "guest", after=at)
            elif self.goal is None:
                sequencer.post(what, after=at)

    def begin(self, program: Robot) -> Any:
        """Run the robot's task from its beginning."""
        nodes = dict.fromkeys(self.things, "thing")
        program.knowledge.apply(Delta(nodes=nodes, added=tuple(self.facts)), "test")
        if self.goal is None:
            return program.run("main", prepare=self.prepare, until=LIMIT)
        return program.achieve(self.goal, replans=self.replans, prepare=self.prepare, until=LIMIT)


@dataclass
class Life:
    """One run to its end: the end, the facts then, the macrosteps without their records, and the records."""

    end: Any
    facts: list[str]
    steps: list[Any]
    records: list[Record]
    world: World


class Trial:
    """One random robot, run as a whole and killed at random moments.

    Attributes:
        wrong: the broken promises.
        counts: how often things happened.
    """

    def __init__(self, seed: int, kills: int = 2) -> None:
        self.robot = RandomRobot(seed)
        self.wrong: list[str] = []
        self.counts: Counter[str] = Counter()
        self._crashes: list[tuple[Path, World]] = []
        with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:  # noqa: S108
            self._live(Path(folder), kills)

    def _live(self, folder: Path, kills: int) -> None:
        (folder / "whole").mkdir()
        draw = Random(self.robot.seed * 7 + 1)
        whole = self._life(folder / "whole", World(), {draw.randint(1, 120) for _ in range(kills)})
        self._judge(whole)
        for crashed, world in self._crashes:
            try:
                again = self._life(crashed, world, resume=True)
            except StoreError:  # it was killed before its first commit, or after its end
                continue
            self.counts["kills"] += 1
            self.counts["kills with other steps"] += whole.steps != again.steps  # messages of one moment have no order
            for what in ("end", "facts"):
                was, now = getattr(whole, what), getattr(again, what)
                if was != now:
                    self.wrong.append(f"killed and resumed at {crashed.name}, {what} differ: {_difference(was, now)}")

    def _life(self, folder: Path, world: World, crashes: Any = (), *, resume: bool = False) -> Life:
        records: list[Record] = []
        store, robot = folder / "run.kb", self.robot

        with robot.program(world, store) as program:

            def receive(record: Record) -> None:
                records.append(record)
                if not resume:  # a resumed program first tells the records of the whole run again
                    self._look(record, program)
                if len(records) in crashes:
                    self._crashes.append((copied(folder, folder.parent / f"crash{len(records)}"), world.after_a_kill()))

            program.listen(receive)
            end = program.resume() if resume else robot.begin(program)
            facts = sorted(map(str, program.knowledge.facts()))
        with archive(store) as runs:
            steps = [replace(step, records=()) for step in runs.steps(runs.run().number)]
        self.wrong += world.wrong
        self.wrong += [f"{name} still does {ids} at the end" for name, ids in world.running.items() if ids]
        divergence = replay(store).divergence
        if divergence is not None:
            self.wrong.append(f"the replay differs: {divergence}")
        return Life(end, facts, steps, records, world)

    def _look(self, record: Record, program: Robot) -> None:
        """No step starts with a broken condition."""
        if record.type != "action" or record.data["action"] != "start" or not record.data["skill"].endswith(".act"):
            return
        self.counts["steps"] += 1
        step = PlanStep(record.data["arguments"]["action"], (record.data["arguments"]["x"],))
        needed = self.robot.domain.ground(step).condition
        if not holds(needed, program.knowledge):
            self.wrong.append(f"{step} starts at {record.t} although its condition is broken")

    def _judge(self, life: Life) -> None:
        robot, end = self.robot, life.end
        self.counts["reached" if end.reached else "not reached"] += 1
        if end.programming_error is not None:
            self.wrong.append(f"programming error: {end.programming_error}")
        if not end.finished and end.problem is not None and "until" in end.problem:
            self.wrong.append(f"no end: {end.problem}")
        if robot.goal is not None:
            with_facts = Robot(
                robot.domain,
                map(parse_plot, robot.plots),
                [Device(n, robot, World()) for n in COMPONENTS],
                clock="simulated",
            )
            with with_facts as known:
                nodes = dict.fromkeys(robot.things, "thing")
                known.knowledge.apply(Delta(nodes=nodes, added=tuple(_fact_of(text) for text in life.facts)), "test")
                if end.reached != known.knowledge.ask(robot.goal):
                    self.wrong.append(f"reached is {end.reached}, but the goal {robot.goal} is not")
        starts = [one.data["id"] for one in life.records if one.type == "action" and one.data["action"] == "start"]
        self.wrong += [f"{one} was started twice" for one, often in Counter(starts).items() if often > 1]
        self.wrong += _cancelled_and_begun_again(life.records)


def _cancelled_and_begun_again(records: list[Record]) -> list[str]:
    """Steps that were cancelled for a new plan and begin again at the same moment: they belong to the new plan."""
    by_seq = {one.seq: one for one in records}
    actions = [one for one in records if one.type == "action" and one.data.get("skill", "").endswith(".act")]
    starts = {one.data["id"]: one for one in actions if one.data["action"] == "start"}
    wrong = []
    for one in actions:
        cause: Record | None = one
        while cause is not None and cause.type != "event":
            cause = by_seq.get(cause.cause or 0)
        if one.data["action"] != "cancel" or cause is None or cause.data["name"] != "plan_found":
            continue
        start = starts[one.data["id"]]
        for later in starts.values():
            same = later.data["arguments"] == start.data["arguments"] and later.seq > one.seq and later.t == one.t
            if same and _region_of(later, by_seq) == _region_of(start, by_seq):
                wrong.append(f"{start.data['arguments']} was cancelled at {one.t} and begun again")
    return wrong


def _region_of(start: Record, by_seq: dict[int, Record]) -> str:
    """The outermost state with the step that starts a skill."""
    step = by_seq[start.cause or 0]
    entered = [path for micro in step.data["microsteps"] for path in micro["entered"] if path.endswith("/go")]
    return entered[-1].partition("/")[0] if entered else ""


def _fact_of(text: str) -> Any:
    return fact(*text.strip("()").split())


def _difference(was: Any, now: Any) -> str:
    if isinstance(was, list):
        at = next(
            (n for n, (one, other) in enumerate(zip(was, now, strict=False)) if one != other), min(len(was), len(now))
        )
        return f"at {at} of {len(was)} and {len(now)}: {str(was[at : at + 1])[:400]} / {str(now[at : at + 1])[:400]}"
    return f"{was} / {now}"


def tried(seed: int, kills: int = 2) -> tuple[int, list[str], Counter[str]]:
    """The broken promises of one seed, and the counts."""
    logging.disable(logging.CRITICAL)
    try:
        trial = Trial(seed, kills)
    except PlotError:  # a rule that no state can follow
        return seed, [], Counter(refused=1)
    except Exception as error:  # noqa: BLE001  # any error is a finding
        import traceback

        return seed, [f"{type(error).__name__}: {error}", traceback.format_exc()], Counter()
    return seed, trial.wrong, trial.counts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--kills", type=int, default=2)
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    broken: list[tuple[int, list[str]]] = []
    seeds = range(options.first, options.first + options.runs)
    with multiprocessing.get_context("spawn").Pool(os.cpu_count()) as pool:
        for number, (seed, wrong, counted) in enumerate(pool.imap(partial(tried, kills=options.kills), seeds), start=1):
            counts += counted
            if wrong:
                broken.append((seed, wrong))
                print(f"seed {seed}: {wrong[0]}", flush=True)
            if number % 200 == 0:
                print(f"{number} robots, {len(broken)} with broken promises", flush=True)
    told = ", ".join(f"{what} {often}" for what, often in sorted(counts.items()))
    print(f"{len(seeds)} random robots: {told}; promises broken by {len(broken)}")
    for seed, _ in broken[:10]:
        print(f"  again: make soak-robots RUNS=1 FIRST={seed}")
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
