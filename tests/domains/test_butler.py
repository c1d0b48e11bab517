"""The butler: the paper's sequences, a mishap in each phase, faults by seed, a second robot, and sources of speech."""

from __future__ import annotations

import os
import sys
from itertools import pairwise

import pytest

from domains.butler import Scenario, bundle
from domains.butler.bringup import FOLDER
from domains.butler.flat import DOORS, FURNITURE, ROOMS, Flat
from domains.butler.speech import command, from_prompt
from dsc.calls import SkillCall
from dsc.errors import SkillError
from dsc.events import Event
from dsc.sequencer.clock import LoopClock, run_real, run_simulated
from dsc.text.profiles import find_profile
from dsc.trace import Record
from knowledge_base.errors import InputError
from planning import deploy


def served(*says, closed=(), profile=None, prepare=None, **how):
    """Return the end of a run with these sentences, its records, and the simulation."""
    records: list[Record] = []
    scenario = Scenario(says=says, closed=closed)
    settings = None if profile is None else find_profile(profile, FOLDER / "profiles")
    with deploy(bundle(), scenario=scenario, profile=settings, listener=records.append, **how) as robot:
        end = robot.run("serve", prepare=prepare)
        return end, records, robot.simulation


def chosen(records):
    return [record.data["chosen"] for record in records if record.type == "decision"]


def commands(records):
    """Return the commands to components, and the drives, in order."""
    said = []
    for record in records:
        match record.data:
            case {"action": "switch", "component": component, "mode": mode}:
                said.append(f"{component} {mode}")
            case {"action": "set", "port": port, "value": value} if port.startswith("base"):
                said.append(f"{port} {value}")
            case {"action": "start", "skill": skill} if skill.startswith("base"):
                said.append(skill)
    return said


def test_a_room_is_approached_with_map_and_path_and_an_object_without():
    end, records, _ = served("go to the dining room", "approach the shelf")
    assert end.outputs == {"served": 2, "refused": 0}
    assert chosen(records) == ["approach_room", "approach_object"]
    to_room = [
        "mapper mapping", "path_planner navigating", "base.speed 0.6", "base.avoidance narrow", "base.follow_path",
        "path_planner neutral", "mapper neutral",
    ]  # fmt: skip
    to_object = ["base.speed 0.3", "base.avoidance wide", "base.go_straight"]
    assert commands(records) == [*to_room, *to_room, *to_object, *to_room]  # there, back, there, back


def test_the_way_leads_through_doors():
    _, records, simulation = served("go to the dining room")
    found = next(one for one in records if one.type == "event" and one.data["name"] == "path_found")
    points = [(stop["x"], stop["y"]) for stop in found.data["attributes"]["path"]]
    assert points == [ROOMS["hall"].middle, DOORS["hall", "dining_room"], ROOMS["dining_room"].middle]
    assert simulation.flat.robot == ROOMS["hall"].middle


def test_fetch_is_planned():
    end, records, simulation = served("please bring me the juice")
    assert end.outputs == {"served": 1, "refused": 0}
    (plan,) = [record.data["steps"] for record in records if record.type == "plan.found"]
    assert plan == ["(go hall fridge)", "(take juice fridge)", "(go fridge hall)", "(give juice)"]
    assert simulation.flat.items["juice"] == "person"


@pytest.mark.parametrize(
    ("words", "closed", "answer"),
    [
        ("sing a song", (), "I did not understand you"),
        ("", (), "I did not understand you"),
        ("go to the cellar", (), "I do not know this place"),
        ("go to the juice", (), "I do not know this place"),
        ("go to the sofa", (), "a wall is in the way"),
        ("go to the kitchen", ("hall-kitchen",), "no way leads there"),
        ("fetch the moon", (), "I cannot fetch this"),
        ("fetch the juice", ("hall-kitchen",), "I could not fetch this"),
    ],
)
def test_a_command_that_cannot_be_obeyed_is_answered_and_the_next_one_is_heard(words, closed, answer):
    end, _, simulation = served(words, "go to the shelf", closed=closed)
    assert end.finished, end.reason
    assert simulation.said == [answer]
    assert end.outputs == {"served": 1, "refused": 1}


def test_a_person_in_the_way_is_waited_for_and_an_item_that_slips_is_taken_again():
    for seed in range(30):
        end, records, simulation = served("go to the kitchen", "fetch the book", seed=seed, faults=0.4)
        names = [record.data["name"] for record in records if record.type == "event"]
        if "stuck" in names and "not_taken" in names:
            break
    assert end.finished
    assert end.outputs["served"] >= 1
    assert (simulation.flat.items["book"] == "person") == (not simulation.left())


def test_a_lost_person_is_answered():
    answers = {tuple(served("follow me", seed=seed, faults=0.5)[2].said) for seed in range(8)}
    assert answers == {(), ("I have lost you",)}


@pytest.mark.parametrize("at", [3.0, 12.0])
def test_stop_ends_a_movement(at):
    end, _, simulation = served(
        "go to the living room", "fetch the book", prepare=lambda sequencer: sequencer.post(Event("stop"), after=at)
    )
    assert end.finished
    assert end.outputs["served"] + end.outputs["refused"] == 2
    assert simulation.flat.room_of(simulation.flat.robot) == "hall"


@pytest.mark.parametrize("seed", range(1, 51))
def test_an_evening_with_faults_ends_with_the_goal_or_an_honest_report(seed):
    with deploy(bundle(), seed=seed, faults=0.2) as robot:
        report = robot.report()
        assert report.problem is None
        assert report.goal_reached == (robot.simulation.flat.items["juice"] == "person")
        assert report.outputs["served"] + report.outputs["refused"] == 6


def test_the_plots_run_on_a_second_robot_by_its_profile_alone():
    says = ("go to the kitchen", "go to the shelf", "fetch the cup", "follow me")
    wheels, records, _ = served(*says, profile="on_wheels")
    tracks, slower, simulation = served(*says, profile="on_tracks")
    assert wheels.outputs == tracks.outputs == {"served": 4, "refused": 0}
    assert chosen(records) == chosen(slower)
    assert slower[-1].t > 1.2 * records[-1].t
    assert simulation.flat.items["cup"] == "person"


def test_each_place_is_reached_by_a_path_from_each_other_one():
    flat = Flat()
    places = {**{name: room.middle for name, room in ROOMS.items()}, **FURNITURE}
    for start in places.values():
        for end in places.values():
            flat.robot = start
            path = flat.path(end)
            assert path is not None
            for one, other in pairwise(path):
                assert flat.is_free(one, other)


@pytest.mark.parametrize(
    ("words", "event", "attributes"),
    [
        ("Go to the dining room.", "go_to", {"where": "dining_room"}),
        ("please fetch me a juice", "fetch", {"what": "juice"}),
        ("Robot, follow me", "follow", {}),
        ("go", "not_understood", {"words": "go"}),
    ],
)
def test_sentences_are_commands(words, event, attributes):
    found = command(words)
    assert (found.event, dict(found.attributes)) == (event, attributes)


def test_a_prompt_is_heard_in_real_time():
    read, write = os.pipe()
    os.write(write, b"go to the kitchen\nfollow me\n")

    async def main():
        with os.fdopen(read) as stream:
            sentence = from_prompt(stream)
            call = SkillCall("a1", LoopClock(), lambda _: None)
            first = await sentence(call)
            os.close(write)
            return first, await sentence(call), await sentence(call)

    assert run_real(main()) == ("go to the kitchen", "follow me", None)


def test_a_prompt_in_simulated_time_is_refused():
    async def main():
        await from_prompt(sys.stdin)(SkillCall("a1", LoopClock(), lambda _: None))

    with pytest.raises(SkillError, match="real time"):
        run_simulated(main())


@pytest.mark.parametrize("text", ["says: 3", "syas: [go]", "says: [go to the hall]\nclosed: 1"])
def test_a_scenario_with_a_mistake_names_its_line(tmp_path, text):
    file = tmp_path / "bad.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=r"bad\.yaml:"):
        deploy(bundle(), scenario=file)


def test_the_shipped_scenario_is_read():
    assert len(Scenario.of(None, FOLDER / "scenarios" / "evening.yaml").says) == 6
