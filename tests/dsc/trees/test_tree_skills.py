"""Trees of XML files as skills: ticked while active, halted at the end, with ports as arguments and outputs."""

from __future__ import annotations

import asyncio

import pytest
from dsc_runs import Arm, Ran

from dsc.outcomes import Outcome
from dsc.trees import Action, Condition, bind_tree, parse_trees, tree_skill
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, fact


class Served(Outcome): ...


class NotServed(Outcome): ...


def file(body, more="", head='BTCPP_format="4" main_tree_to_execute="Main"'):
    return parse_trees(
        f'<root {head}>\n<BehaviorTree ID="Main">\n{body}\n</BehaviorTree>\n{more}\n</root>', "serve.xml"
    )


MODEL = """<TreeNodesModel>
<Action ID="Look"><input_port name="place" default="kitchen"/><output_port name="item"/></Action>
</TreeNodesModel>"""
TAKE = '<Sequence><Look place="hall" item="{seen}"/><RetryUntilSuccessful num_attempts="3"><Grasp item="{seen}" force="2.5" times="2"/></RetryUntilSuccessful></Sequence>'


class Butler(Arm):
    def __init__(self, fails=0):
        super().__init__()
        self.fails = fails
        self.answers = iter([True] * 1000)

    async def glance(self, call, place):
        await call.clock.sleep(1.0)
        self.note(f"look {place}")
        return Outcome("seen", {"item": "cup1"})

    async def seize(self, call, item, force, times, seconds=1.0) -> Outcome:
        self.note(f"grasp {item} {force!r} {times!r}")
        try:
            await call.clock.sleep(seconds)
        except asyncio.CancelledError:
            self.note("cancelled")
            raise
        self.fails -= 1
        return Outcome(
            "slipped" if self.fails >= 0 else "grasped",
            observed=Delta(nodes={item: "item"}, added=(fact("seen", item),)),
        )

    def leaves(self, call):
        async def grasp(item: str, force: float, times: int) -> Outcome:
            return await self.seize(call, item, force, times)

        return {"Look": Action(lambda place: self.glance(call, place), {"seen"}), "Grasp": Action(grasp, {"grasped"})}

    @tree_skill(Served, NotServed)
    def takes(self, call):
        return bind_tree(file(TAKE, MODEL), self.leaves(call))

    @tree_skill(Served, NotServed, period=0.5)
    def guards(self, call, item: str = "cup1"):
        body = '<ReactiveSequence><Open/><Grasp item="{item}" force="1" times="1000"/></ReactiveSequence>'

        async def grasp(item: str, force: float, times: int) -> Outcome:
            return await self.seize(call, item, force, times, seconds=1e6)

        leaves = {"Open": Condition(lambda: next(self.answers)), "Grasp": Action(grasp, {"grasped"})}
        return bind_tree(file(body), leaves, entries={"item": item})

    @tree_skill(Served, NotServed, period=10.0)
    def waits(self, call):
        body = '<Sequence><Sleep msec="1500"/><Delay delay_msec="250"><Note/></Delay><Timeout msec="500"><Grasp/></Timeout></Sequence>'
        leaves = {
            "Note": Condition(lambda: self.note(call.clock.now()) is None),
            "Grasp": Action(lambda: self.seize(call, "cup1", 1, 1), {"grasped"}),
        }
        return bind_tree(file(body), leaves)

    @tree_skill(Served, NotServed)
    def spins(self, call):
        body = '<Repeat num_cycles="1000"><Script code="x := 1"/></Repeat>'
        return bind_tree(file(body), {})

    @tree_skill(Served, NotServed)
    def skips(self, call):
        return bind_tree(file('<AlwaysSuccess _skipIf="true"/>'), {})

    @tree_skill(Served, NotServed)
    def returns_text(self, call):
        return TAKE

    @tree_skill(Served, NotServed)
    def misses(self, call):
        return bind_tree(
            file('<Fallback><Look place="hall" item="{seen}"/></Fallback>', MODEL),
            {"Look": Action(self.nothing, {"seen"})},
        )

    async def nothing(self, place):
        return Outcome("seen")


SERVE = """
    plot: p
    emits: {sorry: {}, broken: {}}
    states:
      a: {entry: {trigger: arm.SKILL}, after: {seconds: LIMIT, to: e}, on: {served: e, not_served: {to: e, emit: sorry}, timed_out: e, programming_error: {to: e, emit: broken}}}
      e: {final: true}
"""


def serve(skill, butler=None, limit=60):
    return Ran(SERVE.replace("SKILL", skill).replace("LIMIT", str(limit)), arm=butler or Butler())


@pytest.mark.parametrize(("fails", "tries", "end"), [(0, 1, None), (2, 3, None), (3, 3, "sorry")])
def test_ports_are_arguments_and_outputs_are_entries(fails, tries, end):
    ran = serve("takes", Butler(fails))
    assert ran.arm.log == ["look hall", *["grasp cup1 2.5 2"] * tries]
    assert [event.name for event in ran.end.emitted] == ([end] if end else [])


def test_a_cancelled_skill_halts_its_tree():
    ran = serve("guards", limit=5)
    assert ran.arm.log == ["grasp cup1 1.0 1000", "cancelled"]


def test_a_condition_that_becomes_false_halts_the_action():
    butler = Butler()
    butler.answers = iter([True, True, False])
    ran = serve("guards", butler)
    assert ran.arm.log == ["grasp cup1 1.0 1000", "cancelled"]


def test_timers_shorten_the_pause_between_ticks():
    ran = serve("waits")
    assert ran.arm.log == [1.75, "grasp cup1 1 1", "cancelled"]
    assert len(ran.end.emitted) == 1


def test_a_tree_that_wakes_itself_leaves_time_to_others():
    assert serve("spins").end.emitted == ()


def test_a_skipped_tree_is_not_a_success():
    assert len(serve("skips").end.emitted) == 1


@pytest.mark.parametrize("skill", ["returns_text", "misses"])
def test_a_mistake_of_the_program_is_a_programming_error(skill):
    ran = serve(skill)
    assert "broken" in str(ran.end.emitted)


def ok():
    return True


async def act(item: int, kind: str = "any"):
    return Outcome("done")


BAD = [
    ("<Grasp/>", "", {}, "serve.xml:3:1: <Grasp> is a leaf without a function"),
    ("<Grasp/>", "", {"Grap": Condition(ok)}, "did you mean 'Grap'?"),
    ("<AlwaysSucces/>", "", {}, "did you mean 'AlwaysSuccess'?"),
    ("<Open/>", "", {"Open": Condition(ok), "Opn": Condition(ok)}, "serve.xml:2:1: the tree 'Main' has no leaf 'Opn'; did you mean 'Open'?"),
    ('<Open dor="1"/>', "", {"Open": Condition(lambda door: True)}, "serve.xml:3:1: <Open>: its function has no parameter 'dor'; did you mean 'door'?"),
    ("<Open/>", "", {"Open": Condition(lambda door: True)}, "serve.xml:3:1: <Open> needs the port 'door'"),
    ('<Act item="two"/>', "", {"Act": Action(act, {"done"})}, "serve.xml:3:1: <Act>: the port 'item' has 'two': Input should be a valid integer"),
    ('<Condition ID="Act" item="2"/>', "", {"Act": Action(act, {"done"})}, "serve.xml:3:1: <Act> is condition in the file, and action in the program"),
    ('<Act item="1" out="here"/>', "", {"Act": Action(act, {"done"}, outputs={"out"})}, "the output port 'out' names an entry"),
    ("<Open/>", "", {"Open": ok}, "serve.xml:3:1: <Open> needs Action(…) or Condition(…)"),
]  # fmt: skip


@pytest.mark.parametrize(("body", "more", "leaves", "said"), BAD)
def test_mistakes_of_a_binding_are_errors_before_the_first_tick(body, more, leaves, said):
    with pytest.raises(InputError) as caught:
        bind_tree(file(body, more), leaves)
    assert said in str(caught.value)


def test_an_unknown_tree_is_an_error_with_the_nearest_name():
    with pytest.raises(InputError, match="did you mean 'Main'"):
        bind_tree(file("<AlwaysSuccess/>"), {}, tree="Mian")
