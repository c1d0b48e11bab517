"""A component here, behind a local and behind a lossy transport: equal checks, ranges, profiles, failures, limits (S2.6)."""

from __future__ import annotations

import asyncio
from typing import Literal

import pytest
from dsc_charts import plot

from dsc import (
    Component,
    Library,
    LoopClock,
    Outcome,
    Parameters,
    Profile,
    Sequencer,
    SkillCall,
    SkillError,
    parameter,
    query,
    skill,
    takes,
)
from dsc.components.life_cycle import Life
from dsc.profiles import configure
from dsc.sequencer.clock import run_simulated
from dsc.testing import LossyTransport
from dsc.validation import validate_library
from dsc.wire import Host, RemoteComponent
from dsc.wire.endpoint import LocalTransport
from knowledge_base import KnowledgeBase, Schema
from knowledge_base.errors import InputError
from planning.robot.bundles import shipped_by


class Weighed(Outcome):
    grams: float


class Moved(Outcome): ...


class ArmParameters(Parameters):
    speed: float = parameter(0.5, least=0.1, most=1.5)
    grip: Literal["soft", "hard"] = "soft"
    port: str = parameter(changed_by="profile")
    limit: float = 2.0
    relations = ("(<= ?speed ?limit)",)


class Arm(Component):
    """An arm that fails in each hook when its text, value or mode asks for it."""

    name = "arm"
    parameters: ArmParameters
    modes = ("ready", "stuck")
    device_errors = (OSError,)
    domain = "(define (domain arm) (:types cup - object) (:predicates (held ?c - cup)))"

    def __init__(self):
        super().__init__()
        self.log = []

    async def start(self):
        self.log.append(f"start {self.parameters.get('port')}")

    async def configure(self, parameter, value):
        await super().configure(parameter, value)
        if value == 1.25:
            raise OSError("cannot be that fast")
        self.log.append(f"{parameter} {value}")

    async def switch(self, mode):
        if mode == "stuck":
            raise OSError("the joint is stuck")
        await super().switch(mode)

    @takes
    async def say(self, text: str):
        if text == "bad":
            raise OSError("loudspeaker")

    @query
    async def weigh(self, cup: str) -> Weighed:
        if cup == "none":
            raise SkillError("nothing is held")
        return Weighed(grams=7)

    @skill
    async def move(self, call: SkillCall, seconds: float) -> Moved:
        if seconds < 0:
            raise ValueError("seconds < 0")
        if seconds == 13:
            asyncio.get_running_loop().call_later(2, self.life.become, Life.FATAL_ERROR, "the cable")
        await call.clock.sleep(seconds)
        return Moved()


@pytest.fixture(params=["here", "local", "lossy"])
def where(request):
    return request.param


async def connected(where, arm):
    """The arm itself, or its client, and what closes it."""
    if where == "here":
        return arm, None
    transport = LocalTransport() if where == "local" else LossyTransport(seed=5, loss=0.2, double=0.2, delay=0.1)
    host = Host(arm, transport, LoopClock())
    return await RemoteComponent.connect("arm", transport), host


PROFILE = Profile.model_validate({"profile": "here", "components": {"arm": {"port": "usb3", "speed": 0.7}}})


def ran(where, text, profile=PROFILE, arm=None):
    """How the plot `p` ended, and when."""
    arm = arm or Arm()

    async def main():
        component, host = await connected(where, arm)
        configure([component], profile)
        clock = LoopClock()
        end = await Sequencer(Library([plot(text)]), KnowledgeBase(Schema()), [component], clock).run("p")
        at = clock.now()
        if host is not None:
            await host.close()
        return end, at

    return run_simulated(main())


def asked(entry, on, within=40):
    return f"""
        plot: p
        emits: {{said: {{event: text, why: text}}}}
        states:
          a:
            entry: [{entry}]
            on:
              {on}: e
              skill_error: {{to: e, emit: said, with: {{event: '"skill_error"', why: ?event.reason}}}}
              timed_out: {{to: e, emit: said, with: {{event: '"timed_out"', why: ?event.reason}}}}
            after: {{seconds: {within}, to: e}}
          e: {{final: true}}
    """


CASES = {
    "a skill": ("{trigger: arm.move, with: {seconds: 3}}", None, ""),
    "a slow skill": ("{trigger: arm.move, with: {seconds: 30}, within: 35}", None, ""),
    "a time limit": ("{trigger: arm.move, with: {seconds: 30}, within: 5}", "timed_out", "no outcome within 5 s"),
    "a bug": ("{trigger: arm.move, with: {seconds: -1}}", "programming_error", "ValueError: seconds < 0"),
    "a query": ("{trigger: arm.weigh, with: {cup: c1}, as: {answered: moved}}", None, ""),
    "a failed query": ("{trigger: arm.weigh, with: {cup: none}, as: {answered: moved}}", "skill_error", "nothing is held"),
    "a lost device": ("{trigger: arm.move, with: {seconds: 13}}", "skill_error", "the cable"),
    "a refused value": ("{set: arm.speed, to: 1.25}", "skill_error", "set arm.speed: "),
    "a failed value": ("{set: arm.speed, to: 1.25}", "skill_error", "cannot be that fast"),
    "a value out of range": ("{set: arm.speed, to: 9}", "programming_error", "'arm.speed' is from 0.1 to 1.5; found 9"),
    "a word out of range": ("{set: arm.grip, to: sfot}", "programming_error", "did you mean 'soft'"),
    "an unknown parameter": ("{set: arm.spede, to: 1}", "programming_error", "has no parameter 'spede'; did you mean 'speed'"),
    "a violated relation": ("{set: arm.limit, to: 0.2}", "programming_error", "needs (<= ?speed ?limit)"),
    "a failed mode": ("{switch: arm, to: stuck}", "skill_error", "the joint is stuck"),
    "an unknown mode": ("{switch: arm, to: raedy}", "programming_error", "has no mode 'raedy'; did you mean 'ready'"),
    "a failed message": ("{send: arm.say, with: {text: bad}}", "skill_error", "loudspeaker"),
    "an unknown port": ("{send: arm.sya, with: {text: bad}}", "programming_error", "takes no 'sya'; did you mean 'say'"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_each_call_and_each_failure(where, case):
    entry, event, why = CASES[case]
    end, at = ran(where, asked(entry, "moved"))
    if event is None:
        assert (end.finished, end.emitted) == (True, ()), end
    elif event == "programming_error":
        assert not end.finished
        assert why in (end.programming_error or ""), end
    else:
        (said,) = end.emitted
        assert said.attributes["event"] == event
        assert why in said.attributes["why"]
    assert at < 36


def test_a_profile_has_its_effect_before_the_start(where):
    arm = Arm()
    end, _ = ran(where, asked("{trigger: arm.move, with: {seconds: 1}}", "moved"), arm=arm)
    assert end.finished
    assert arm.log == ["start usb3"]
    assert (arm.parameters.speed, arm.parameters.port) == (0.7, "usb3")


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"port": "usb3", "speed": 9}, "'arm.speed' is from 0.1 to 1.5; found 9"),
        ({"port": "usb3", "spede": 1}, "has no parameter 'spede'; did you mean 'speed'"),
        ({}, "'arm.port' has no value"),
    ],
)
def test_a_wrong_profile_is_refused(where, values, why):
    with pytest.raises(InputError, match=why.replace("(", r"\(")):
        ran(
            where,
            asked("{trigger: arm.move, with: {seconds: 1}}", "moved"),
            Profile.model_validate({"profile": "here", "components": {"arm": values}}),
        )


def test_the_checks_before_a_run(where):
    async def main():
        component, host = await connected(where, Arm())
        text = plot(asked("{set: arm.speed, to: 9}, {set: arm.spede, to: 1}, {trigger: arm.mvoe}", "moved"))
        declared = {component.name: component.interface()}
        found = validate_library(Library([text]), Schema(), list(component.skills().values()), declared)
        if host is not None:
            await host.close()
        return "\n".join(map(str, found)), shipped_by([component])

    found, fragments = run_simulated(main())
    for why in ("is from 0.1 to 1.5; found 9", "did you mean 'speed'", "did you mean 'arm.move'"):
        assert why in found
    assert len(fragments) == 1


@pytest.mark.parametrize("seed", range(20))
def test_the_reason_of_a_lost_device_arrives_whichever_frame_is_lost(seed):
    async def main():
        arm, transport = Arm(), LossyTransport(seed, loss=0.3, double=0.3, delay=0.3)
        host = Host(arm, transport, LoopClock())
        component = await RemoteComponent.connect("arm", transport)
        configure([component], PROFILE)
        library = Library([plot(asked("{trigger: arm.move, with: {seconds: 13}}", "moved"))])
        end = await Sequencer(library, KnowledgeBase(Schema()), [component], LoopClock()).run("p")
        await host.close()
        return end

    (said,) = run_simulated(main()).emitted
    assert "the cable" in said.attributes["why"]
