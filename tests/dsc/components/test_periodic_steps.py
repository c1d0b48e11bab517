"""Components execute a step at a fixed frequency while they are active (S4.13)."""

from __future__ import annotations

import asyncio

import pytest
from dsc_runs import ran

from dsc import Component, LoopClock, Outcome, SkillCall, run_simulated, skill
from dsc.components.assembly import require_instances
from dsc.components.life_cycle import Life
from dsc.components.periodic_steps import StepCounts
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from dsc.wire.remote import RemoteComponent
from knowledge_base.errors import InputError


class Held(Outcome): ...


class Wheel(Component):
    """A wheel that logs the times of its steps; `takes` has the durations of the first steps."""

    name = "wheel"
    modes = ("driving",)
    device_errors = (OSError,)
    period = 0.1

    def __init__(self, takes=(), fails_at=None):
        super().__init__()
        self.takes = list(takes)
        self.fails_at = fails_at
        self.log: list[float] = []
        self.others: list[str] = []

    def now(self):
        return asyncio.get_running_loop().time()

    async def start(self):
        self.others.append(f"start {self.now():g}")

    async def activate(self, active):
        self.others.append(f"{'on' if active else 'off'} {self.now():g}")

    async def step(self):
        self.log.append(self.now())
        if len(self.log) == self.fails_at:
            raise OSError("no encoder")
        if self.takes:
            try:
                await asyncio.sleep(self.takes.pop(0))
            finally:
                self.others.append(f"step ends {self.now():g}")

    @skill
    async def hold(self, call: SkillCall, seconds: float = 1.0) -> Held:
        await call.clock.sleep(seconds)
        return Held()


HOLD = """
    plot: p
    states:
      before: {after: {seconds: 2, to: work}}
      work: {entry: {trigger: wheel.hold}, on: {held: between, skill_error: between}}
      between: {after: {seconds: 2, to: drive}}
      drive: {entry: {switch: wheel, to: driving}, exit: {switch: wheel, to: neutral}, after: {seconds: 0.55, to: after}}
      after: {after: {seconds: 2, to: e}}
      e: {final: true}
"""


def test_steps_are_exact_in_simulated_time_and_end_with_the_activity():
    wheel = Wheel()
    end, at = ran(HOLD, wheel)
    assert (end.problem, at) == (None, pytest.approx(7.55))
    first = [2 + number * 0.1 for number in range(11)]
    assert wheel.log[:10] == first[:10]
    driving = wheel.log[-6:]
    assert driving == [driving[0] + number * 0.1 for number in range(6)]
    assert driving[0] == pytest.approx(5)
    assert wheel.life.steps == StepCounts(begun=len(wheel.log))


def test_a_step_that_takes_too_long_makes_later_ones_late_or_missed():
    wheel = Wheel(takes=[0.15, 0, 0, 0.37])
    ran(HOLD, wheel)
    begun = [round(at - 2, 6) for at in wheel.log if at < 3]
    assert begun == [0, 0.15, 0.2, 0.3, 0.67, 0.7, 0.8, 0.9]
    assert (wheel.life.steps.late, wheel.life.steps.missed) == (2, 2)
    assert asyncio.run(wheel.diagnose())["steps"] == {"begun": len(wheel.log), "late": 2, "missed": 2}


def test_a_step_ends_before_the_component_becomes_inactive():
    wheel = Wheel(takes=[50])
    ran(HOLD, wheel)
    assert wheel.others[:4] == ["start 2", "on 2", "step ends 3", "off 3"]


def test_a_component_that_cannot_step_has_failed():
    wheel = Wheel(fails_at=4)
    end, _ = ran(HOLD, wheel)
    assert end.problem is None
    assert wheel.others[2:5] == ["off 2.3", "start 4.3", "on 4.3"]
    assert wheel.log[4] == pytest.approx(4.3)


def test_a_component_does_not_step_while_its_device_is_lost():
    class Cabled(Wheel):
        lost = False

        async def start(self):
            if self.lost:
                raise OSError("no cable")
            await super().start()

    wheel = Cabled()

    async def cable(_):
        await asyncio.sleep(5.22)
        wheel.lost = True
        wheel.life.become(Life.FATAL_ERROR, "unplugged")
        await asyncio.sleep(0.2)
        wheel.lost = False
        wheel.life.become(Life.ALIVE)

    ran(HOLD, wheel, meanwhile=cable)
    assert [round(at, 6) for at in wheel.log if at > 5.1] == [5.2, 5.42, 5.52]


def test_a_component_at_a_host_steps_there():
    wheel = Wheel()

    async def main():
        transport = LocalTransport()
        host = Host(wheel, transport, LoopClock())
        remote = await RemoteComponent.connect("wheel", transport)
        await remote.life.come_alive()
        await remote.life.become_active(1, active=True)
        await asyncio.sleep(1)
        steps = (await remote.diagnose())["steps"]
        await remote.life.become_active(1, active=False)
        await asyncio.sleep(1)
        number = len(wheel.log)
        await asyncio.sleep(1)
        await host.close()
        return steps, number

    steps, number = run_simulated(main())
    assert steps["begun"] >= 10
    assert number == len(wheel.log)


@pytest.mark.parametrize(
    ("period", "said"),
    [(None, "is a positive number of seconds, not None"), (0, "not 0"), ("fast", "not 'fast'"), (True, "not True")],
)
def test_a_period_that_is_no_time_is_refused(period, said):
    wheel = Wheel()
    wheel.period = period
    with pytest.raises(InputError, match=said):
        require_instances([wheel])


def test_a_period_without_a_step_is_refused():
    class Slip(Component):
        period = 0.1

        async def stepp(self): ...

    with pytest.raises(InputError, match="component 'slip' has a `period`, and no hook `async def step\\(self\\)`"):
        require_instances([Slip()])
