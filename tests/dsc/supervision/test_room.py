"""Resources: active components share a capacity; old ones leave first, and the more urgent ones come first (S1.9, S1.21)."""

from __future__ import annotations

import asyncio
from typing import Any, ClassVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsc import ALWAYS, Component, Demand, Outcome, SkillCall, parse_plot, skill
from dsc.trace import Record
from knowledge_base import InputError, UnknownNameError
from planning import Robot

DOMAIN = "(define (domain room) (:predicates (done)))"


class Looked(Outcome):
    at: float


class Camera(Component):
    modes = ("night",)
    demands: ClassVar = {
        ALWAYS: Demand(resources={"memory": 600}),
        "night": Demand(resources={"memory": 300}),
    }
    log: ClassVar[list[str]] = []

    async def activate(self, active: bool) -> None:
        if not active:
            await asyncio.sleep(1.0)  # it needs time to leave
        self.log.append(f"{'+' if active else '-'}{self.name}")

    @skill
    async def look(self, call: SkillCall, seconds: float = 2.0) -> Looked:
        await call.clock.sleep(seconds)
        return Looked(at=call.clock.now())


@pytest.fixture(autouse=True)
def empty_log():
    Camera.log.clear()


def run(plot: str, *components: Component, **capacity: Any):
    with Robot(DOMAIN, [parse_plot(plot)], components, clock="simulated", resources=capacity or None) as robot:
        return robot.run("p")


ONE_BY_ONE = """
plot: p
states:
  first: {entry: {trigger: left.look}, on: {looked: second}}
  second: {entry: {trigger: right.look}, on: {looked: over}}
  over: {final: true}
"""


def parallel(*regions: str, outputs: str = "{}") -> str:
    """A plot with regions `WAIT COMPONENT SETTINGS`: each waits, then executes `look`; `#` is the number of the region."""
    text = f"plot: p\noutputs: {outputs}\nstates:\n  all:\n    regions:\n"
    for number, region in enumerate(regions):
        seconds, component, settings = region.split(" ", 2)
        text += (
            f"      r{number}:\n        states:\n          w{number}: {{after: {{seconds: {seconds}, to: v{number}}}}}\n"
            f"          v{number}: {settings.replace('COMPONENT', component).replace('#', str(number))}\n"
            f"          e{number}: {{final: true}}\n"
        )
    return text + "    on: {done: over}\n  over: {final: true}\n"


LOOK = "{entry: {trigger: COMPONENT.look}, on: {looked: e#}}"


def test_a_component_leaves_before_another_one_needs_its_room():
    assert run(ONE_BY_ONE, Camera("left"), Camera("right"), memory=1000).reached
    assert Camera.log == ["+left", "-left", "+right", "-right"]


def test_the_trace_has_the_waits_for_resources_and_their_ends():
    records: list[Record] = []
    plot = parallel(f"0 left {LOOK}", f"1 right {LOOK}")
    with Robot(DOMAIN, [parse_plot(plot)], [Camera("left"), Camera("right")], clock="simulated",
               resources={"memory": 1000}) as robot:  # fmt: skip
        robot.listen(records.append)
        assert robot.run("p").reached
    waits = [(one.t, one.data["waits"]) for one in records if one.type == "component"]
    assert waits == [(1.0, "it needs 600 of 'memory'; of 1000, left uses 600"), (3.0, None)]


def test_without_capacities_components_overlap():
    assert run(ONE_BY_ONE, Camera("left"), Camera("right")).reached
    assert Camera.log[:2] == ["+left", "+right"]


def test_the_more_urgent_skill_has_the_room_first():
    cameras = [Camera(name) for name in ("left", "middle", "right")]
    urgent = f"0.2 right {LOOK.replace('{entry', '{priority: 5, entry')}"
    assert run(parallel(f"0.1 left {LOOK}", f"0.1 middle {LOOK}", urgent), *cameras, memory=1000).reached
    assert [one for one in Camera.log if one[0] == "+"] == ["+left", "+right", "+middle"]


@pytest.mark.parametrize("names", [("ant", "zed"), ("zed", "ant")])
def test_of_equal_ranks_the_earlier_one_has_the_room_first(names):
    cameras = [Camera(name) for name in ("mid", "ant", "zed")]
    first, second = names
    plot = parallel(f"0.1 mid {LOOK}", f"0.3 {second} {LOOK}", f"0.2 {first} {LOOK}")
    assert run(plot, *cameras, memory=1000).reached
    assert [one for one in Camera.log if one[0] == "+"] == ["+mid", f"+{first}", f"+{second}"]


def test_a_wait_for_room_ends_with_the_deadline_and_its_reason():
    long = "0.1 left {entry: {trigger: COMPONENT.look, with: {seconds: 100}}, on: {looked: e#}}"
    late = "{to: e#, assign: {reason: ?event.reason}}"
    bounded = "0.2 right {entry: {trigger: COMPONENT.look, within: 5}, on: {looked: e#, timed_out: " + late + "}}"
    plot = parallel(long, bounded, outputs="{reason: {type: text, initial: nothing}}")
    end = run(plot, Camera("left"), Camera("right"), memory=1000)
    assert (
        "'right', which waits for resources: it needs 600 of 'memory'; of 1000, left uses 600" in end.outputs["reason"]
    )


def test_a_mode_that_needs_more_waits_for_the_room():
    day = "0.1 left {entry: {trigger: COMPONENT.look, with: {seconds: 10}}, on: {looked: {to: e#, assign: {day: ?event.at}}}}"
    entry = "[{switch: COMPONENT, to: night}, {trigger: COMPONENT.look}]"
    night = "1 right {entry: " + entry + ", on: {looked: {to: e#, assign: {night: ?event.at}}}}"
    numbers = "{day: {type: number, initial: 0}, night: {type: number, initial: 0}}"
    narrow, wide = (
        run(parallel(day, night, outputs=numbers), Camera("left"), Camera("right"), memory=capacity).outputs
        for capacity in (1400, 1500)
    )
    assert narrow["night"] > narrow["day"] > 10
    assert wide["night"] < wide["day"]


def test_demands_that_never_fit_are_refused():
    with pytest.raises(InputError, match=r"component 'left' needs 900 of 'memory', and the robot has 800"):
        run(ONE_BY_ONE, Camera("left"), Camera("right"), memory=800)
    for capacity in ("a", -1, True, float("nan")):
        with pytest.raises(InputError, match="the capacity of 'memory' is a number from 0 on"):
            run(ONE_BY_ONE, Camera("left"), Camera("right"), memory=capacity)
    with pytest.raises(UnknownNameError, match="component 'left' needs 'memory', which the robot does not have"):
        run(ONE_BY_ONE, Camera("left"), Camera("right"), memori=800)


class Part(Component):
    """A component that counts what is active."""

    active: ClassVar[dict[str, int]] = {}
    most: ClassVar[int] = 0

    modes = ("large",)

    def __init__(self, name: str, amount: int, more: int, needs: tuple[str, ...]) -> None:
        super().__init__(name)
        self.amount = amount
        self.needs = {ALWAYS: needs}  # type: ignore[misc]
        always, large = Demand(resources={"memory": amount}), Demand(resources={"memory": more})
        self.demands = {ALWAYS: always, "large": large}  # type: ignore[misc]

    async def activate(self, active: bool) -> None:
        await asyncio.sleep(0.1)
        if active:
            self.active[self.name] = self.amount
        else:
            del self.active[self.name]
        type(self).most = max(self.most, sum(self.active.values()))

    @skill
    async def look(self, call: SkillCall, seconds: float) -> Looked:
        await call.clock.sleep(seconds)
        return Looked(at=call.clock.now())


@st.composite
def robots(draw: st.DrawFn):
    number = draw(st.integers(2, 5))
    amounts = draw(st.lists(st.integers(0, 5), min_size=number, max_size=number))
    more = draw(st.lists(st.integers(0, 5), min_size=number, max_size=number))
    needs = [
        tuple(f"c{n}" for n in draw(st.sets(st.integers(0, k - 1), max_size=2))) if k else () for k in range(number)
    ]
    starts = draw(st.lists(st.floats(0, 3).map(lambda x: round(x, 1)), min_size=number, max_size=number))
    spare = draw(st.integers(0, 6))
    return amounts, more, needs, starts, spare


@given(robots())
def test_the_capacity_is_never_exceeded_and_each_skill_ends(robot):
    amounts, more, needs, starts, spare = robot
    chains: list[set[int]] = []
    for k, others in enumerate(needs):
        chains.append({k}.union(*(chains[int(name[1:])] for name in others)))
    capacity = max(sum(amounts[n] + more[n] for n in chain) for chain in chains) + spare
    Part.active.clear()
    Part.most = 0
    trigger = "{trigger: COMPONENT.look, with: {seconds: 1}}"
    larger = (
        "{entry: [{switch: COMPONENT, to: large}, "
        + trigger
        + "], exit: {switch: COMPONENT, to: neutral}, on: {looked: e#}}"
    )
    look = "{entry: " + trigger + ", on: {looked: x#}}\n          x#: " + larger
    plot = parallel(*(f"{at + 0.1:g} c{n} {look}" for n, at in enumerate(starts)))
    parts = [Part(f"c{n}", amount, more[n], needs[n]) for n, amount in enumerate(amounts)]
    assert run(plot, *parts, memory=capacity).reached
    assert Part.most <= capacity
    assert Part.active == {}
