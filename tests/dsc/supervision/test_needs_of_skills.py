"""Dependencies of components: failures, hanging hooks and losses, each with the name of the component that has them."""

from __future__ import annotations

import asyncio
from typing import ClassVar

import pytest
from dsc_runs import ran

from dsc.components.component import ALWAYS, Component
from dsc.components.life_cycle import Life
from dsc.errors import NotAliveError
from dsc.outcomes import Outcome
from dsc.sequencer.clock import run_simulated
from dsc.skills import skill
from dsc.supervision.activation import ComponentActivation
from dsc.supervision.component_registry import ComponentRegistry
from dsc.supervision.skill_dependencies import SkillDependencies

DRIVE = """
    plot: p
    variables: {why: text}
    emits: {broken: {why: text}, bug: {why: text}}
    states:
      a:
        entry: {trigger: laser.scan, within: 20}
        on:
          arrived: e
          skill_error: {to: e, emit: broken, with: {why: ?event.reason}}
          programming_error: {to: e, emit: bug, with: {why: ?event.reason}}
          timed_out: {to: e, emit: broken, with: {why: ?event.reason}}
      e: {final: true}
"""


class Arrived(Outcome): ...


class Base(Component):
    name = "base"


class Laser(Component):
    name = "laser"
    needs: ClassVar = {ALWAYS: ("base",)}

    @skill
    async def scan(self, call) -> Arrived:
        await call.clock.sleep(5)
        return Arrived()


def reason_of_scan(*components, meanwhile=None, outcome="broken"):
    end, _ = ran(DRIVE, *components, meanwhile=meanwhile)
    (event,) = end.emitted
    assert event.name == outcome
    return event.attributes["why"]


def test_a_skill_names_the_hook_of_the_needed_component_for_which_it_waits():
    class Hanging(Base):
        async def start(self):
            await asyncio.Event().wait()

    why = reason_of_scan(Laser(), Hanging())
    assert "component 'base'" in why
    assert "executes base.start" in why


def test_a_bug_in_the_start_of_a_needed_component_is_a_programming_error_of_the_skill():
    class Wrong(Base):
        async def start(self):
            raise KeyError("port")

    why = reason_of_scan(Laser(), Wrong(), outcome="bug")
    assert why.startswith("base.start: KeyError: 'port'")


def test_a_bug_that_ends_a_needed_component_is_the_cause_of_the_loss():
    class Wrong(Base):
        period = 2.0
        ticks = 0

        async def step(self):
            self.ticks += 1
            if self.ticks > 1:
                raise KeyError("port")

    assert "KeyError: 'port'" in reason_of_scan(Laser(), Wrong(), outcome="bug")


def test_a_device_that_ends_a_needed_component_is_no_bug():
    base = Base()

    async def unplug(_):
        await asyncio.sleep(2)
        base.life.become(Life.FATAL_ERROR, "unplugged")

    assert reason_of_scan(Laser(), base, meanwhile=unplug) == (
        "laser.scan: NotAliveError: it needs component 'base', which is in 'fatal_error': unplugged"
    )


def test_each_component_whose_needs_have_a_bug_is_named():
    class Unsure(Component):
        def needed(self):
            raise KeyError(self.name)

    first, second = Unsure("first"), Unsure("second")
    activation = ComponentActivation(ComponentRegistry({"first": first, "second": second}), tuple)
    for one in (first, second, first):
        with pytest.raises(Exception, match=f"`needed` of component '{one.name}' has failed: .*'{one.name}'"):
            activation.needed(one)


def test_work_does_not_begin_on_a_component_that_is_lost_before():
    async def main():
        laser = Component("alone")
        await laser.life.come_alive()
        laser.life.become(Life.FATAL_ERROR, "unplugged")
        activation = ComponentActivation(ComponentRegistry({"alone": laser}), tuple)
        await SkillDependencies(activation, laser).carrying(asyncio.sleep(5))

    with pytest.raises(NotAliveError, match="unplugged"):
        run_simulated(main())


def test_a_mode_of_a_state_without_a_skill_keeps_its_needs_active_until_the_component_is_neutral():
    log = []

    class Lamp(Base):
        async def activate(self, active):
            log.append((asyncio.get_running_loop().time(), active))

    class Scanner(Component):
        name = "laser"
        modes = ("scanning",)
        needs: ClassVar = {"scanning": ("base",)}

    text = """
        plot: p
        states:
          a: {entry: {switch: laser, to: scanning}, after: {seconds: 2, to: b}}
          b: {entry: {switch: laser, to: neutral}, after: {seconds: 3, to: e}}
          e: {final: true}
    """
    ran(text, Scanner(), Lamp())
    assert [(round(at, 6), active) for at, active in log] == [(0, True), (2, False)]
