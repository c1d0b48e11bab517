"""Dialogue by arcs: who answers, how requests end, and that none is served twice."""

from __future__ import annotations

import asyncio
import io
import os
import random
from collections import Counter

import pytest

from domains.dialogue import Console, Dialogue, Script, TextFiles
from dsc import run_simulated
from dsc.errors import SkillError
from dsc.sequencer.clock import SimulatedEventLoop
from dsc.sequencer.run_end import RunEnd
from dsc.text.plot_files import parse_plot
from knowledge_base.facts import Change, Delta, fact
from planning import Robot

PERSONS = [f"person{n}" for n in range(10)]
HALL = Delta(nodes=dict.fromkeys(["robot", *PERSONS], "agent"))
ASKING = parse_plot("""
plot: asking
parameters: {to: agent, topic: text}
outputs: {answer: {type: text, initial: ""}, reason: {type: text, initial: ""}}
states:
  work:
    regions:
      talk: {states: {serve: {use: serve_dialogue, with: {me: robot, patience: 10}}}}
      mission:
        states:
          ask:
            use: ask_agent
            with: {me: robot, to: ?to, topic: ?topic}
            on: {done: {to: asked, assign: {answer: ?event.answer}}, unanswered: {to: asked, assign: {reason: ?event.reason}}}
          asked: {always: {to: answered, emit: enough}}
          answered: {final: true}
    on: {enough: over}
  over: {final: true}
""")


def with_channels(*channels, **options) -> Robot:
    robot = Robot.of_bundles(["dialogue"], plots=[ASKING], components=[Dialogue(*channels)], **options)
    if not robot.knowledge.version:
        robot.knowledge.apply(HALL, author="me")
    return robot


def asked(robot: Robot, topic: str = "Which floor is this?") -> RunEnd:
    return robot.run("asking", {"to": "person1", "topic": topic})


def test_an_answer_becomes_an_arc_in_the_opposite_direction():
    changes: list[Change] = []
    with with_channels(Script(lambda to, topic: f"{to} says 3"), clock="simulated") as robot:
        robot.knowledge.subscribe(changes.append)
        end = asked(robot)
        facts = [str(one) for change in changes for one in change.delta.added if one.predicate != "pending"]
        left = robot.knowledge.facts()
    assert end.outputs["answer"] == "person1 says 3"
    assert facts == [
        '(ask robot person1 "Which floor is this?")',
        '(reply person1 robot "Which floor is this?" "person1 says 3")',
    ]
    assert [str(one) for one in left if one.predicate != "pending"] == facts[1:]


@pytest.mark.parametrize(
    ("script", "reason"),
    [(Script(lambda to, topic: None), "nobody answers"), (Script(lambda to, topic: "3", 60), "no answer in time")],
)
def test_the_reason_of_a_question_without_an_answer(script, reason):
    with with_channels(script, clock="simulated") as robot:
        assert asked(robot).outputs == {"answer": "", "reason": reason}


def test_the_first_answer_of_several_channels():
    slow, fast, deaf = Script(lambda *_: "slow", 5), Script(lambda *_: "fast", 2), Script(lambda *_: None, 0)
    with with_channels(slow, deaf, fast, clock="simulated") as robot:
        assert asked(robot).outputs["answer"] == "fast"
    assert slow.said == deaf.said == fast.said == [("person1", "Which floor is this?")]


def test_an_answer_by_another_program():
    async def main() -> RunEnd:
        async with with_channels(Script(lambda *_: "late", 9)) as robot:
            run = robot.start("asking", {"to": "person1", "topic": "Tea?"})
            await asyncio.sleep(3)
            run.change(Delta(added=(fact("reply", "person1", "robot", "Tea?", "yes"),)), "page")
            return await run

    assert run_simulated(main()).outputs["answer"] == "yes"


def test_an_answer_to_an_earlier_question_does_not_count():
    with with_channels(Script(lambda *_: "3"), clock="simulated") as robot:
        robot.knowledge.apply('(reply person1 robot "Which floor is this?" "2")', author="person")
        assert asked(robot).outputs["answer"] == "3"


def test_the_end_of_one_channel_does_not_end_the_others():
    class Broken(Script):
        async def receive(self, call, to, topic):
            raise SkillError("no microphone")

    with with_channels(Broken(lambda *_: ""), Script(lambda *_: "3"), clock="simulated") as robot:
        end = asked(robot)
    assert end.outputs["answer"] == "3"


def test_a_console_as_a_channel():
    read, write = os.pipe()
    os.write(write, b"fourth floor\n")
    said = io.StringIO()
    with os.fdopen(read) as reads, with_channels(Console(reads, said), clock="real") as robot:
        assert asked(robot).outputs["answer"] == "fourth floor"
    os.close(write)
    assert said.getvalue() == "to person1: Which floor is this?\n"


def test_two_lines_that_arrive_together():
    read, write = os.pipe()
    os.write(write, b"fourth floor\n\nfifth floor\nsi")
    with os.fdopen(read) as reads:
        console = Console(reads, io.StringIO())
        with with_channels(console, clock="real") as robot:
            assert asked(robot).outputs["answer"] == "fourth floor"
            assert asked(robot).outputs["answer"] == "fifth floor"
            os.write(write, b"xth floor")
            os.close(write)
            assert asked(robot).outputs["answer"] == "sixth floor"
            assert asked(robot).outputs["reason"] == "nobody answers"


def test_a_console_in_simulated_time():
    with with_channels(Console(io.StringIO(), io.StringIO()), clock="simulated") as robot:
        assert "dsc run --real-time" in asked(robot).outputs["reason"]


def test_text_files_as_a_channel(tmp_path):
    said, heard = tmp_path / "said.txt", tmp_path / "answers.txt"
    heard.write_text("an answer of yesterday\n")

    async def main() -> list[str]:
        async with with_channels(TextFiles(said, heard)) as robot:
            answers = []
            for words in ("first", "second"):
                run = robot.start("asking", {"to": "person1", "topic": "Which floor is this?"})
                await asyncio.sleep(1)
                with heard.open("a") as file:
                    file.write(f"{words}\nhalf a li" if words == "second" else f"{words}\n")
                answers.append((await run).outputs["answer"])
            return answers

    assert run_simulated(main()) == ["first", "second"]
    assert said.read_text() == "person1: Which floor is this?\n" * 2


def test_equal_arcs_by_console_page_files_and_script(tmp_path):
    """One arc serves all channels (S4.18)."""
    answers = tmp_path / "answers.txt"

    class Later(TextFiles):
        async def receive(self, call, to, topic):
            answers.write_text("3\n")
            return await super().receive(call, to, topic)

    class Page:
        async def show(self, call, to, words): ...

        async def receive(self, call, to, topic):
            robot.knowledge.apply(Delta(added=(fact("reply", to, "robot", topic, "3"),)), author="page")
            await call.clock.sleep(60)

    read, write = os.pipe()
    os.write(write, b"3\n")
    os.close(write)
    found = []
    with os.fdopen(read) as console:
        for channel, clock in [
            (Console(console, io.StringIO()), "real"),
            (Page(), "simulated"),
            (Later(tmp_path / "said.txt", answers), "simulated"),
            (Script(lambda *_: "3"), "simulated"),
        ]:
            with with_channels(channel, clock=clock) as robot:
                end = asked(robot)
                added = [one for change in robot.knowledge.changes(since=1) for one in change.delta.added]
                found.append((end.outputs, [str(one) for one in added if one.predicate != "pending"]))
    arcs = ['(ask robot person1 "Which floor is this?")', '(reply person1 robot "Which floor is this?" "3")']
    assert found == [({"answer": "3", "reason": ""}, arcs)] * 4


SERVING = parse_plot("""
plot: serving
receives: {enough: {}}
states:
  serve: {use: serve_dialogue, with: {me: robot, patience: 5, oldest: 400}, on: {enough: over}}
  over: {final: true}
""")
FATES = ["answers", "is silent", "answers too late", "page answers", "is retracted"]


@pytest.mark.parametrize("seed", range(5))
def test_each_of_200_disturbed_requests_ends_once(seed):
    chance = random.Random(seed)  # noqa: S311  requests, not keys
    requests = [(chance.choice(PERSONS), chance.choice(FATES), chance.random() * 4) for _ in range(200)]
    fates = {f"question {n}": fate for n, (_, fate, _) in enumerate(requests)}

    def answer(_to: str, topic: str) -> str | None:
        return None if fates[topic] == "is silent" else f"answer to {topic}"

    class Persons(Script):
        async def receive(self, call, to, topic):
            if fates[topic] != "answers":
                await call.clock.sleep(6)
            return await super().receive(call, to, topic)

    script = Persons(answer, seconds=1)
    ends = Counter[str]()

    def note(change) -> None:
        ends.update(one.args[2] for one in change.delta.added if one.predicate in ("reply", "unanswered"))
        ends.update(one.args[2] for one in change.delta.removed if one.predicate == "ask" and change.author == "asker")

    async def main() -> None:
        async with Robot.of_bundles(["dialogue"], plots=[SERVING], components=[Dialogue(script)]) as robot:
            robot.knowledge.apply(HALL, author="me")
            robot.knowledge.subscribe(note)
            run = robot.start("serving", open_ended=True)
            for n, (person, fate, pause) in enumerate(requests):
                ask = fact("ask", "robot", person, f"question {n}")
                run.change(Delta(added=(ask,)), "asker")
                await asyncio.sleep(pause)
                if robot.knowledge.ask("(ask robot ?p ?t)", {"p": person, "t": f"question {n}"}):
                    if fate == "page answers":
                        run.change(Delta(added=(fact("reply", person, "robot", f"question {n}", "ok"),)), "page")
                    elif fate == "is retracted":
                        run.change(Delta(removed=(ask,)), "asker")
            while robot.knowledge.query("(ask ?a ?b ?c)"):  # noqa: ASYNC110  simulated time
                await asyncio.sleep(5)
            run.post("enough")
            await run

    run_simulated(main())
    assert set(ends) == set(fates)
    assert max(Counter(words for _, words in script.said).values()) == 1
    assert max(ends.values()) == 1


def test_a_request_that_waits_too_long_is_retracted():
    async def main() -> list[str]:
        async with Robot.of_bundles(
            ["dialogue"], plots=[SERVING], components=[Dialogue(Script(lambda *_: None, 3))]
        ) as robot:
            robot.knowledge.apply(HALL, author="me")
            for n in range(150):
                robot.knowledge.apply(f'(ask robot person1 "question {n}")', author="me")
            run = robot.start("serving", open_ended=True)
            while robot.knowledge.query("(ask ?a ?b ?c)"):  # noqa: ASYNC110  simulated time
                await asyncio.sleep(5)
            run.post("enough")
            await run
            return [str(one["r"]) for one in robot.knowledge.query("(unanswered robot person1 ?t ?r)")]

    reasons = Counter(run_simulated(main()))
    assert reasons["it has waited too long"] > 10
    assert reasons["nobody answers"] >= 100
    assert reasons.total() == 150


@pytest.mark.parametrize("second", [0.5, 1.5, 2.9])
def test_a_killed_dialogue_serves_each_request_once(tmp_path, second):
    def robot(script: Script) -> Robot:
        return with_channels(script, store=tmp_path / "run.kb")

    async def begin() -> None:
        kept.append(asyncio.ensure_future(killed.start("asking", {"to": "person1", "topic": "Tea?"}).task))
        await asyncio.sleep(second)

    kept: list[asyncio.Future[object]] = []  # a killed program cleans nothing up
    killed = robot(Script(lambda *_: "3"))
    SimulatedEventLoop().run_until_complete(begin())
    killed.knowledge.close()

    async def resume() -> tuple[RunEnd, list[str]]:
        async with robot(Script(lambda *_: "3")) as two:
            end = await two.resuming()
            changes = two.knowledge.changes(since=1)
            return end, [str(one) for c in changes for one in c.delta.added if one.predicate == "reply"]

    end, replies = run_simulated(resume())
    assert end.outputs["answer"] == "3"
    assert replies == ['(reply person1 robot "Tea?" "3")']


def test_sentences_of_anybody():
    plot = parse_plot("""
plot: hearing
outputs: {words: {type: text, initial: ""}, ended: {type: boolean, initial: false}}
states:
  work:
    regions:
      talk: {states: {serve: {use: serve_dialogue, with: {me: robot}}}}
      mission:
        states:
          greet: {use: say_to, with: {me: robot, to: person1, words: hello}, on: {done: listen}}
          listen:
            use: listen_as
            with: {me: robot}
            on: {done: {to: listen, assign: {words: ?event.words}}, nothing_heard: {to: deaf, assign: {ended: true}}}
          deaf: {always: {to: all_heard, emit: enough}}
          all_heard: {final: true}
    on: {enough: over}
  over: {final: true}
""")
    script = Script.of_lines(["bring tea", "bring juice"])
    robot = Robot.of_bundles(["dialogue"], plots=[plot], components=[Dialogue(script)], clock="simulated")
    with robot:
        robot.knowledge.apply(HALL, author="me")
        end = robot.run("hearing")
    assert end.outputs == {"words": "bring juice", "ended": True}
    assert script.said == [("person1", "hello")]
