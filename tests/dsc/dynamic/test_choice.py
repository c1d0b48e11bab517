"""Choice among candidates that fit: by order, priority, utility or cost; exclusion of failed candidates (S0.14)."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsc_charts import plot
from hypothesis import given
from hypothesis import strategies as st

from dsc import Component, Outcome, SkillCall, has_run, is_unfinished, parse_plot, replay, skill
from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.events import Event
from dsc.testing import Crashes, one_history, replays, violations
from dsc.trace import Record
from dsc.validation.library import validate_plot
from dsc.validation.review import review_plot
from knowledge_base.facts import Delta, fact
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema
from planning import Robot

SCHEMA = Schema.parse("""
    (define (domain paths)
      (:types place)
      (:predicates (blocked ?p - place))
      (:functions (metres ?p - place)))
""")
FIRST = "{plot: first, parameters: {to: place}, states: {s: {final: true}}, %s}"
SECOND = "{plot: second, parameters: {to: place, slow: {type: number, default: 2}}, states: {s: }, %s}"


def decide(choose: str, first: str, second: str):
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes={"sink": "place"}, values={fact("metres", "sink"): 3}), "test")
    holder = plot(f"""
        plot: p
        states:
          h: {{dynamic: [first, second], with: {{to: sink}}, {choose}, on: {{done: fine, no_candidate: fine}}}}
          fine: {{final: true}}
    """)
    library = Library([holder, plot(FIRST % first), plot(SECOND % second)])
    made = Machine(library).start("p", {}, KnowledgeSituation(kb, library)).decisions[0].decision
    return made.chosen, [one.score for one in made.verdicts]


@pytest.mark.parametrize(
    ("choose", "first", "second", "chosen", "scores"),
    [
        ("choose: order", "utility: 1", "utility: 2", "first", [None, None]),
        ("choose: priority", "priority: 1", "priority: 2", "second", [1, 2]),
        ("choose: utility", "utility: (metres ?to)", "utility: (* ?slow (metres ?to))", "second", [3, 6]),
        ("choose: cost", "cost: (metres ?to)", "cost: (* ?slow (metres ?to))", "first", [3, 6]),
        ("choose: cost", "cost: 1", "cost: 1", "first", [1, 1]),
        ("choose: utility", "utility: 1", "utility: 2, when: (blocked ?to)", "first", [1, None]),
        ("choose: utility", "about: it has no utility", "utility: -5", "second", [None, -5]),
        ("choose: cost", "about: it has no cost", "about: nor this one", "first", [None, None]),
    ],
)
def test_the_best_candidate_that_fits_is_chosen(choose, first, second, chosen, scores):
    assert decide(choose, first, second) == (chosen, scores)


@given(st.lists(st.integers(-3, 3), min_size=1, max_size=6), st.sampled_from(["utility", "priority", "cost"]))
def test_of_equal_candidates_the_first_one_is_chosen(scores, by):
    names = [f"c{number}" for number in range(len(scores))]
    holder = plot(f"""
        plot: p
        states:
          h: {{dynamic: [{", ".join(names)}], choose: {by}, on: {{done: fine, no_candidate: fine}}}}
          fine: {{final: true}}
    """)
    plots = [
        plot(f"{{plot: {name}, {by}: {score}, states: {{s: }}}}") for name, score in zip(names, scores, strict=True)
    ]
    library = Library([holder, *plots])
    made = Machine(library).start("p", {}, KnowledgeSituation(KnowledgeBase(SCHEMA), library)).decisions[0].decision
    best = min(scores) if by == "cost" else max(scores)
    assert made.chosen == names[scores.index(best)]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("utility: (metres ?from)", "there is no variable '?from'"),
        ("utility: (meters ?to)", "did you mean 'metres'?"),
        ("utility: ?to", "number"),
        ("cost: near", "number"),
        ("about: nothing", "has no `utility`"),
    ],
)
def test_mistakes_in_scores_are_found(text, said):
    holder = plot("""
        plot: p
        states:
          h: {dynamic: [first], choose: utility, with: {to: sink}, on: {done: fine, no_candidate: fine}}
          fine: {final: true}
    """)
    library = Library([holder, plot(FIRST % text)])
    found = [one for each in library for one in validate_plot(each, library, SCHEMA)]
    found += review_plot(holder, library)
    assert any(said in str(one.error) for one in found), [str(one) for one in found]


# -- exclusion -----------------------------------------------------------------------------------------------


class Held(Outcome): ...


class Missed(Outcome): ...


class Arm(Component):
    """An arm whose hand always misses until a second of run time."""

    name = "arm"
    misses_until = 1e9

    @skill(after_crash="repeat")
    async def grasp(self, call: SkillCall, tool: str, item: str = "cup") -> Held | Missed:
        await call.clock.sleep(1.0)
        return Missed() if tool == "hand" and item == "cup" and call.clock.now() < self.misses_until else Held()


TOOL = """
plot: %(tool)s
parameters: {item: {type: text, default: cup}}
emits: {missed: }
states:
  try: {entry: {trigger: arm.grasp, with: {tool: %(tool)s, item: ?item}}, on: {held: ok, missed: bad}}
  ok: {final: true}
  bad: {final: true, emit: missed}
"""
MAIN = """
plot: main
variables: {rounds: {type: number, initial: 0}}
states:
  get: {dynamic: [hand, suction], exclude: {failures: %(failures)s, seconds: %(seconds)s}, on: {missed: get, done: rest, no_candidate: none}}
  rest:
    after:
      - {seconds: 1, when: (< ?rounds %(rounds)s), assign: {rounds: (+ ?rounds 1)}, to: get}
      - {seconds: 1, when: (>= ?rounds %(rounds)s), to: over}
  none: {final: true}
  over: {final: true}
"""


def robot_of(arm=None, tools=("hand", "suction"), failures=2, seconds=10, rounds=4, **how):
    main = MAIN.replace("[hand, suction]", f"[{', '.join(tools)}]")
    plots = [
        main % {"failures": failures, "seconds": seconds, "rounds": rounds},
        *(TOOL % {"tool": tool} for tool in tools),
    ]
    robot = Robot("(define (domain d) (:predicates (p)))", map(parse_plot, plots), [arm or Arm()],
                  **{"clock": "simulated", **how})  # fmt: skip
    records: list[Record] = []
    robot.listen(records.append)
    return robot, records


def chosen(records):
    return [(one.t, one.data["chosen"]) for one in records if one.type == "decision"]


def test_a_candidate_that_has_failed_is_excluded_for_a_time():
    robot, records = robot_of(seconds=5)
    with robot:
        assert robot.run("main").reached
    assert chosen(records) == [
        (0, "hand"), (1, "hand"), (2, "suction"), (4, "suction"), (6, "suction"),  # until second 7
        (8, "hand"), (9, "suction"), (11, "suction"),
    ]  # fmt: skip
    reasons = [one.data["candidates"][0]["reason"] for one in records if one.type == "decision"]
    assert reasons[2] == "it has failed 2 times, and is excluded for 5 s"
    assert reasons[-1] == "it has failed 3 times, and is excluded for 3 s"


def test_a_success_ends_the_count():
    arm = Arm()
    arm.misses_until = 1.5
    robot, records = robot_of(arm, rounds=1)
    with robot:
        assert robot.run("main").reached
    assert chosen(records) == [(0, "hand"), (1, "hand"), (3, "hand")]
    variables = [
        one.data["variables"][""] for one in records if one.type == "step" and "" in one.data.get("variables", {})
    ]
    assert [one["failures in get"] for one in variables if "failures in get" in one] == [
        [["hand", {"item": "cup"}, 1, 0.0]],
        [],
    ]


def test_without_another_candidate_the_state_has_none():
    robot, records = robot_of(tools=("hand",))
    with robot:
        robot.run("main")
    assert chosen(records) == [(0, "hand"), (1, "hand"), (2, None)]


def test_failures_of_other_arguments_exclude_nothing():
    text = """
    plot: main
    variables: {item: {type: text, initial: cup}}
    states:
      get:
        dynamic: [hand]
        with: {item: ?item}
        exclude: {seconds: 100}
        on: {missed: {to: get, assign: {item: can}}, done: over, no_candidate: none}
      over: {final: true}
      none: {final: true}
    """
    robot = Robot("(define (domain d) (:predicates (p)))", [parse_plot(text), parse_plot(TOOL % {"tool": "hand"})], [Arm()],
                  clock="simulated")  # fmt: skip
    records: list[Record] = []
    robot.listen(records.append)
    with robot:
        assert robot.run("main").reached
    assert [one for _, one in chosen(records)] == ["hand", "hand"]
    assert not [one for one in records if one.data.get("name") == "no_candidate"]


def test_a_candidate_that_is_left_by_its_time_limit_has_failed():
    text = """
    plot: main
    states:
      get: {dynamic: [hand, suction], exclude: {seconds: 100}, after: {seconds: 0.5, to: wait}, on: {missed: wait, done: over, no_candidate: over}}
      wait: {after: {seconds: 1, to: get}}
      over: {final: true}
    """
    plots = [text, TOOL % {"tool": "hand"}, "{plot: suction, states: {s: {final: true}}}"]
    robot = Robot("(define (domain d) (:predicates (p)))", map(parse_plot, plots), [Arm()], clock="simulated")
    records: list[Record] = []
    robot.listen(records.append)
    with robot:
        assert robot.run("main").reached
    assert [one for _, one in chosen(records)] == ["hand", "suction"]


def test_an_interruption_is_no_failure():
    text = MAIN.replace("missed: get,", "missed: get, stop: rest,") % {"failures": 1, "seconds": 100, "rounds": 1}
    text = text.replace("variables:", "receives: {stop: }\nvariables:")
    plots = [text, TOOL % {"tool": "hand"}, TOOL % {"tool": "suction"}]
    arm = Arm()
    arm.misses_until = 0.0
    robot = Robot("(define (domain d) (:predicates (p)))", map(parse_plot, plots), [arm], clock="simulated")
    records: list[Record] = []
    robot.listen(records.append)
    with robot:
        assert robot.run("main", prepare=lambda run: run.post(Event("stop"), after=0.5)).reached
    assert [one for _, one in chosen(records)] == ["hand", "hand"]


@pytest.mark.parametrize("seed", range(30))
def test_a_run_that_is_killed_and_resumed_excludes_alike(seed, tmp_path):
    crashes: Crashes[list[tuple[float, str | None]]] = Crashes(tmp_path, seed, chance=0.15, most=6)

    def live(folder: Path):
        store = folder / "run.kb"
        robot, records = robot_of(store=store, seconds=5)
        with robot:
            crashes.inject(robot.components[0])
            if not has_run(store):
                robot.run("main", prepare=crashes.watch)
            elif is_unfinished(store):
                robot.resume(prepare=crashes.watch)
            return chosen(records)

    found = crashes.survive(live)
    robot, records = robot_of(seconds=5)
    with robot:
        robot.run("main")
    assert found in ([], chosen(records))  # nothing: it was killed after its end
    assert crashes.problems == []
    assert violations(crashes.folder / "run.kb", [one_history, replays()]) == []


def test_a_kept_run_is_replayed_with_its_exclusions(tmp_path):
    robot, _ = robot_of(store=tmp_path / "run.db", clock="real", seconds=0.3, rounds=1)
    robot.components[0].misses_until = 1e12
    with robot:
        assert robot.run("main").reached
    replayed = replay(tmp_path / "run.db")
    assert replayed.divergence is None
    assert replayed.steps > 5
