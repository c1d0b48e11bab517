"""Learned choices of dynamic states: experience from kept runs, its use, and its place in kept runs (S0.14)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from dsc import Component, Outcome, SkillCall, has_run, is_unfinished, learn, parse_plot, replay, review_plot, skill
from dsc.chance import uniform
from dsc.cli.runs import app
from dsc.dynamic.experience import Experience, Tries, situation_of
from dsc.dynamic.library import Library
from dsc.runs.learning import tries_in
from dsc.testing import Crashes, one_history, replays, violations
from dsc.text.experience import experience_to_yaml, load_experience, parse_experience
from dsc.trace import Record
from knowledge_base import Delta, InputError, fact
from planning import Robot

DOMAIN = "(define (domain d) (:types item) (:predicates (wet ?i - item) (p)))"
MAIN = """
plot: main
variables: {round: {type: number, initial: 0}}
states:
  grip:
    dynamic: [hand, suction]
    with: {item: cup}
    choose: CHOOSE
    situation: [(wet cup)]
    explore: EXPLORE
    on: {done: {to: more, assign: {round: (+ ?round 1)}}, slipped: grip, no_candidate: over}
  more: {choice: [{when: (< ?round 6), to: grip}, over]}
  over: {final: true}
"""
HAND = """
plot: hand
parameters: {item: item}
emits: {slipped: }
states:
  s: {entry: {trigger: arm.hand, with: {item: ?item}}, on: {held: e, slipped: f}}
  e: {final: true}
  f: {final: true, emit: slipped}
"""
SUCTION = """
plot: suction
parameters: {item: item}
states: {s: {entry: {trigger: arm.suction, with: {item: ?item}}, on: {held: e}}, e: {final: true}}
"""


class Held(Outcome): ...


class Slipped(Outcome): ...


class Arm(Component):
    name = "arm"

    def __init__(self, seed: int = 0) -> None:
        super().__init__()
        self.seed = seed

    @skill(after_crash="repeat")
    async def hand(self, call: SkillCall, item: str) -> Held | Slipped:
        await call.clock.sleep(2)
        return Slipped() if uniform(self.seed, call.action_id, "slip") < 0.7 else Held()

    @skill(after_crash="repeat")
    async def suction(self, call: SkillCall, item: str) -> Held:
        await call.clock.sleep(3)
        return Held()


def robot_of(choose: str = "learned", explore: float = 0.0, seed: int = 0, **how: Any) -> tuple[Robot, list[Record]]:
    text = MAIN.replace("CHOOSE", choose).replace("EXPLORE", str(explore))
    robot = Robot(DOMAIN, map(parse_plot, (text, HAND, SUCTION)), [Arm(seed)], clock="simulated", **how)
    if "cup" not in robot.knowledge.objects("item"):
        robot.knowledge.apply(Delta({"cup": "item"}, added=(fact("wet", "cup"),)), author="test")
    records: list[Record] = []
    robot.listen(records.append)
    return robot, records


def chosen(records: list[Record]) -> list[str]:
    return [one.data["chosen"] for one in records if one.type == "decision"]


def ran(*args: Any, **how: Any) -> list[Record]:
    robot, records = robot_of(*args, **how)
    with robot:
        assert robot.run("main").reached
    return records


WET = (("(wet cup)", True),)
KNOWN = Experience({("main", "hand", WET): Tries(20, 4, 40.0), ("main", "suction", WET): Tries(10, 10, 30.0)})


# -- the model and its file ----------------------------------------------------------------------------------


def test_the_number_is_the_expected_time_until_success():
    assert Tries(20, 4, 40.0).time_to_success == pytest.approx(2 * 22 / 5)
    assert str(Tries(20, 4, 40.0)) == "4 of 20 tries done, 2 s each: 8.8 s until success"


def test_an_unknown_situation_has_the_tries_of_all_situations():
    dry = (("(wet cup)", False),)
    assert KNOWN.of("main", "hand", dry) == Tries(20, 4, 40.0)
    more = KNOWN.plus([(("main", "hand", dry), Tries(1, 1, 2.0))])
    assert more.of("main", "hand", dry) == Tries(1, 1, 2.0)
    assert more.of("main", "foot", dry) is None


names = st.sampled_from(["a", "b", "c-d"])
tries = st.integers(1, 9).flatmap(
    lambda n: st.builds(Tries, st.just(n), st.integers(0, n), st.integers(0, 900).map(float))
)
situations = st.dictionaries(st.sampled_from(["(wet ?i)", "(= (size ?i) 3)"]), st.booleans()).map(situation_of)


@given(st.dictionaries(st.tuples(names, names, situations), tries, max_size=5))
def test_a_file_of_experience_is_read_as_written(found):
    experience = Experience(found)
    assert parse_experience(experience_to_yaml(experience)) == experience
    assert Experience.from_form(json.loads(json.dumps(experience.to_form()))) == experience


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("experience: [{plot: m, candidate: h, tries: 2, done: 3, seconds: 1}]", "3 of 2 tries cannot be done"),
        ("experience: [{plot: m, candidate: h, tries: 0, done: 0, seconds: 1}]", r"e\.yaml:1:"),
        ("experience: [{plot: m, candidat: h, tries: 2, done: 1, seconds: 1}]", "did you mean 'candidate'?"),
        ("tries: []", "the key 'experience' is missing|unknown key 'tries'"),
    ],
)
def test_a_mistake_in_a_file_is_refused_with_its_place(text, said):
    with pytest.raises(InputError, match=said):
        parse_experience(text, "e.yaml")


# -- learning and choosing -----------------------------------------------------------------------------------


def test_without_experience_the_first_candidate_is_chosen():
    assert set(chosen(ran())) == {"hand"}


def test_experience_changes_the_choice_and_is_in_the_decision_record():
    records = ran(experience=KNOWN)
    assert set(chosen(records)) == {"suction"}
    decision = next(one.data for one in records if one.type == "decision")
    assert (decision["by"], decision["plot"], decision["situation"]) == ("learned", "main", {"(wet cup)": True})
    hand, suction = decision["candidates"]
    assert hand["learned"] == "4 of 20 tries done, 2 s each: 8.8 s until success"
    assert suction["score"] == pytest.approx(3 * 12 / 11)


def test_the_digest_of_the_experience_is_in_the_header():
    robot, _ = robot_of(experience=KNOWN)
    with robot:
        assert robot.header()["experience"] == KNOWN.digest


def test_exploration_is_a_function_of_seed_and_activation():
    once, again = chosen(ran("learned", 0.5)), chosen(ran("learned", 0.5))
    assert once == again
    assert set(once) == {"hand", "suction"}
    decisions = [one.data for one in ran("learned", 0.5) if one.type == "decision"]
    assert {one["chosen"] for one in decisions if not one.get("explored")} == {"hand"}


def test_runs_in_order_are_experience_too(tmp_path):
    robot, records = robot_of("order", store=tmp_path / "run.kb")
    with robot:
        robot.run("main")
    found = learn([tmp_path / "run.kb"])
    slipped = sum(
        one.type == "event" and one.data["name"] == "slipped" and one.data["source"] != "arm.hand" for one in records
    )
    count = len(chosen(records))
    assert found.tries == {("main", "hand", WET): Tries(count, 6, 2.0 * count)}
    assert slipped <= count - 6
    assert found == Experience().plus(tries_in(records))


def test_a_try_that_a_surrounding_state_ends_does_not_count():
    text = """
    plot: outer
    states:
      within: {states: {inner: {use: main, on: {done: e}}, e: {final: true}}, on: {done: over}, after: {seconds: 1, to: over}}
      over: {final: true}
    """
    robot, records = robot_of()
    robot.library.add(parse_plot(text))
    with robot:
        robot.run("outer")
    assert chosen(records) == ["hand"]
    assert [*tries_in(records)] == []


def test_the_command_learns_from_stores(tmp_path):
    stores = [tmp_path / f"{seed}.kb" for seed in range(3)]
    for seed, store in enumerate(stores):
        robot, _ = robot_of("learned", 0.5, seed, store=store)
        with robot:
            robot.run("main")
    said = CliRunner().invoke(app, ["learn", *map(str, stores), "--out", str(tmp_path / "e.yaml")])
    assert "main: suction ((wet cup) is true): " in said.stdout
    found = load_experience(tmp_path / "e.yaml")
    assert found == learn(stores)
    assert set(chosen(ran(experience=found))) == {"suction"}


def test_exploration_without_a_learned_choice_is_a_warning():
    text = MAIN.replace("CHOOSE", "order").replace("EXPLORE", "0.2")
    library = Library(map(parse_plot, (text, HAND, SUCTION)))
    found = review_plot(library.plot("main"), library)
    said = "<text>:10:5: state 'grip' explores, and it does not choose by experience"
    assert said in [str(one.error) for one in found if one.level == "warning"]


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("(wet cup)", "(wett cup)", "there is no predicate 'wett'; did you mean 'wet'"),
        ("(wet cup)", "(wet ?cup)", r"'\?cup' is not bound|no variable '\?cup'|\?cup"),
        ("EXPLORE", "1.5", "1"),
        ("CHOOSE", "learnt", "'learned'"),
    ],
)
def test_a_mistake_in_a_state_is_refused(before, after, said):
    text = MAIN.replace(before, after).replace("CHOOSE", "learned").replace("EXPLORE", "0.2")
    with pytest.raises(InputError, match=said):
        Robot(DOMAIN, map(parse_plot, (text, HAND, SUCTION)), [Arm()], clock="simulated")


# -- kept runs -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_a_resumed_run_keeps_the_experience_with_which_it_began(seed, tmp_path):
    crashes: Crashes[Any] = Crashes(tmp_path, seed, chance=0.1, most=3)

    def live(folder: Path) -> Any:
        store = folder / "run.kb"
        begun = has_run(store)
        robot, records = robot_of("learned", 0.3, store=store, experience=None if begun else KNOWN)
        with robot:
            if not begun:
                robot.run("main", prepare=crashes.watch)
            elif is_unfinished(store):
                robot.resume(prepare=crashes.watch)
        return chosen(records)

    crashes.survive(live)
    store = crashes.folder / "run.kb"
    assert crashes.problems == []
    assert violations(store, [one_history, replays()]) == []
    assert replay(store).divergence is None
    scores = {name: one.time_to_success for (_, name, _), one in KNOWN.tries.items()}
    with_score = learned_records(store)
    assert with_score
    assert all(
        {one["plot"]: one["score"] for one in data["candidates"]} == pytest.approx(scores) for data in with_score
    )


def learned_records(store: Path) -> list[dict[str, Any]]:
    from dsc.runs.archive import archive

    with archive(store) as runs:
        return [dict(one.data) for one in runs.records(runs.run().number) if one.type == "decision"]
