"""Waving: one plot with two simulated arms and with a driver of a user; what goes wrong in each phase; kinematics."""

from __future__ import annotations

import asyncio
import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from domains.arm_skills import Arm, Chain, Joint
from domains.waving import DeskArm, HumanoidArm, bundle
from domains.waving.bringup import HOME
from dsc.errors import SkillError
from dsc.text.profiles import find_profile
from dsc.trace import Record
from planning import Bundle, deploy
from planning.robot.simulation import Setup, Simulation

PROFILES = ("desk_arm", "humanoid")


def profile(name):
    return find_profile(name, HOME / "profiles")


def waved(name, **how):
    """Return the end of a run, the angles of the arm after it, and the records."""
    records: list[Record] = []
    with deploy(bundle(), profile=None if name is None else profile(name), listener=records.append, **how) as robot:
        end = robot.run("wave")
        return end, robot.simulation.joints.angles(), records


def angles_of(records, joint):
    """Return the observed angles of a joint, in order."""
    values = [value for one in records if one.type == "knowledge" for value in one.data.get("values", ())]
    return [angle for function, name, angle in values if (function, name) == ("angle", joint)]


def turns(angles):
    """Return how often a joint changes its direction."""
    ways = [math.copysign(1, after - before) for before, after in pairwise(angles) if after != before]
    return sum(one != other for one, other in pairwise(ways))


@pytest.mark.parametrize(("name", "joint"), [("desk_arm", "hand"), ("humanoid", "elbow")])
def test_the_same_plot_waves_with_each_arm(name, joint):
    end, angles, records = waved(name)
    assert end.outputs == {"waved": 3}
    assert turns(angles_of(records, joint)) >= 5
    assert angles[joint] == pytest.approx({"hand": 0, "elbow": 5}[joint])


@pytest.mark.parametrize("name", PROFILES)
def test_no_joint_is_faster_than_the_profile_permits_or_beyond_its_limits(name):
    _, _, records = waved(name)
    arm = HumanoidArm if name == "humanoid" else DeskArm
    pace = 0.8 if name == "humanoid" else 1.0
    for joint in arm.chain.joints:
        seen, at = [arm.start[joint.name]], 0.0
        for record in records:
            for function, thing, angle in record.data.get("values", ()) if record.type == "knowledge" else ():
                if (function, thing) == ("angle", joint.name):
                    assert joint.least - 0.01 <= angle <= joint.most + 0.01
                    assert abs(angle - seen[-1]) <= pace * joint.speed * (record.t - at) + 0.01
                    seen.append(angle)
            if record.type == "knowledge":
                at = record.t


def test_the_page_draws_links_that_meet():
    records: list[Record] = []
    with deploy(bundle(), profile=profile("humanoid"), listener=records.append) as robot:
        assert robot.report().goal_reached
    scenes = [record.data["things"] for record in records if record.type == "scene"]
    assert len(scenes) > 50
    for shoulder, elbow, wrist, tool in scenes:
        assert (shoulder["to_x"], shoulder["to_y"]) == (elbow["x"], elbow["y"])
        assert (wrist["to_x"], wrist["to_y"]) == (tool["x"], tool["y"])


@pytest.mark.parametrize("seed", range(50))
@pytest.mark.parametrize("name", PROFILES)
def test_a_run_with_blocked_joints_waves_or_reports_honestly(name, seed):
    end, _, records = waved(name, seed=seed, faults=0.3)
    blocked = [record for record in records if record.type == "event" and record.data["name"] == "blocked"]
    if end.emitted:
        assert end.emitted[-1].name == "did_not_wave"
        assert end.emitted[-1].attributes["reason"] in {"a joint is blocked", "the arm cannot return"}
        assert len(blocked) >= 3
    else:
        assert end.outputs == {"waved": 3}
    assert end.finished


@pytest.mark.parametrize("phase", ["raise", "left", "right", "rest"])
def test_a_joint_that_stays_blocked_in_a_phase_is_reported(phase):
    class Held(DeskArm):
        def __init__(self, setup):
            super().__init__(setup)
            self.joints._blocks = lambda _: phase in self.active

        active = ""

    own = Bundle.in_folder(HOME, name="held", needs=("arm-skills",), main="wave", simulation=Held)
    with deploy(own) as robot:

        def note(record):
            for micro in record.data["microsteps"] if record.type == "step" else ():
                for path in micro["entered"]:
                    if "/" not in path:
                        robot.simulation.active = path

        robot.listen(note)
        end = robot.run("wave")
    assert end.emitted[-1].name == "did_not_wave"
    assert end.outputs["waved"] == 0 if phase in {"raise", "left", "right"} else 3


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"x": 5}, "the hand cannot be raised so far"),
        ({"left": "hand 120"}, "a pose is outside of the limits"),
    ],
)
def test_a_wrong_configuration_is_reported(arguments, reason):
    with deploy(bundle()) as robot:
        end = robot.run("wave", arguments)
    assert end.emitted[-1].attributes == {"reason": reason}


@pytest.mark.parametrize("pose", ["hnad 40", "hand", "hand forty"])
def test_a_wrong_pose_names_itself(pose):
    with deploy(bundle()) as robot:
        end = robot.run("wave", {"left": pose})
    assert not end.finished
    assert pose.split()[0] in end.reason


class Servo:
    """A driver as a user writes one, with another clock of its own movements."""

    def __init__(self, chain, start):
        self.now = dict(start)
        self.fails = False
        self.moves = 0

    def angles(self):
        return dict(self.now)

    async def move(self, call, targets, seconds, moved):
        if self.fails:
            raise SkillError("no power")
        self.moves += 1
        await call.clock.sleep(seconds)
        self.now.update(targets)
        moved()


def with_servo(servo):
    class Real(Simulation):
        def components(self):
            return [Arm(DeskArm.chain, servo)]

    return Bundle.in_folder(HOME, name="real", needs=("arm-skills",), main="wave", simulation=Real)


def test_a_robot_with_a_driver_only_waves_with_the_same_plot():
    servo = Servo(DeskArm.chain, DeskArm.start)
    with deploy(with_servo(servo)) as robot:
        assert robot.run("wave").outputs == {"waved": 3}
    assert servo.moves == 8


def test_a_driver_that_fails_ends_the_run_with_its_reason():
    servo = Servo(DeskArm.chain, DeskArm.start)
    servo.fails = True
    with deploy(with_servo(servo)) as robot:
        end = robot.run("wave")
    assert "no power" in end.reason


def test_a_cancelled_movement_stops_the_arm():
    simulation = DeskArm(Setup())
    (arm,) = simulation.components()

    async def main():
        from dsc.calls import SkillCall
        from dsc.sequencer.clock import LoopClock

        call = SkillCall("a1", LoopClock(), lambda _: None)
        task = asyncio.ensure_future(arm.execute("move_joints", call, {"targets": {"base": 60}}))
        await asyncio.sleep(0.35)
        task.cancel()
        await asyncio.wait([task])
        return simulation.joints.angles()["base"]

    from dsc.sequencer.clock import run_simulated

    assert 60 < run_simulated(main()) < 90


angles = st.floats(-60, 60)


@given(st.lists(st.tuples(st.floats(0.05, 1), angles), min_size=1, max_size=7))
def test_links_have_their_lengths_in_every_pose(parts):
    chain = Chain([Joint(f"j{n}", length) for n, (length, _) in enumerate(parts)])
    points = chain.points({f"j{n}": angle for n, (_, angle) in enumerate(parts)})
    for (length, _), one, other in zip(parts, points, points[1:], strict=False):
        assert math.dist(one, other) == pytest.approx(length)


@given(st.lists(angles, min_size=3, max_size=3))
def test_a_pose_that_exists_is_found_again(pose):
    chain = Chain([Joint("a", 0.4, -90, 90), Joint("b", 0.3, -90, 90), Joint("c", 0.2, -90, 90)])
    limits = {joint.name: (joint.least, joint.most) for joint in chain.joints}
    tool = chain.points(dict(zip("abc", pose, strict=True)))[-1]
    found = chain.angles_for(tool, {"a": 0.0, "b": 10.0, "c": 10.0}, limits)
    assert found is not None
    assert math.dist(chain.points(found)[-1], tool) < 0.01
    assert all(least <= found[name] <= most for name, (least, most) in limits.items())
