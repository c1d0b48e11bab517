"""One skill as a plot."""

from typing import Annotated

import pytest

from dsc import Component, Library, Outcome, primitive_plot, skill, validate_plot
from dsc.skills import SkillSignature
from knowledge_base import InputError, SchemaError, UnknownNameError

Item = Annotated[str, "item"]


class Grasped(Outcome): ...


class Slipped(Outcome):
    item: Item


class Arm(Component):
    name = "arm"

    @skill
    async def grasp(self, call, item: Item, force=1) -> Grasped | Slipped:
        return Grasped()


GRASP = Arm().skills()["grasp"]


def test_it_is_done_after_one_outcome_and_emits_every_other():
    plot = primitive_plot(GRASP, done="grasped", name="take", implements="pick-up", when="(free)", effects="assumed")
    assert (plot.name, plot.implements, plot.effects) == ("take", "pick-up", "assumed")
    assert plot.emits == {"slipped": {"item": "item"}}
    assert {name: one.type for name, one in plot.parameters.items()} == {"item": "item", "force": "symbol"}
    (slipped,) = plot.states["execute"].on["slipped"]
    assert (slipped.emit, slipped.target) == ("slipped", "ended")


def test_a_parameter_that_the_skill_can_do_without_may_be_left_out():
    plot = primitive_plot(GRASP, done="grasped")
    holder = {"plot": "h", "states": {"s": {"use": "grasp", "with": {"item": "cup"}, "on": {"done": "e", "slipped": "e"}},
                                      "e": {"final": True}}}  # fmt: skip
    made = type(plot).model_validate(holder)
    assert validate_plot(made, Library([made, plot]), None, [GRASP], {"arm"}) == []


def test_an_outcome_that_the_skill_does_not_have_is_an_error():
    with pytest.raises(UnknownNameError, match="did you mean 'grasped'"):
        primitive_plot(GRASP, done="grapsed")


def test_an_outcome_that_is_the_executives_is_an_error():
    signature = SkillSignature("arm", "grasp", {}, {}, {"grasped": {}, "timed_out": {}})
    with pytest.raises(SchemaError, match=r"skill 'arm\.grasp' cannot have the outcome 'timed_out'"):
        primitive_plot(signature, done="grasped")


def test_its_time_limit_replaces_that_of_the_skill():
    (trigger,) = primitive_plot(GRASP, done="grasped", within=3600).states["execute"].entry
    assert trigger.within == 3600
    (trigger,) = primitive_plot(GRASP, done="grasped").states["execute"].entry
    assert trigger.within is None


@pytest.mark.parametrize("within", [0, -1, True, float("inf"), "60"])
def test_a_time_limit_that_is_none_is_refused(within):
    with pytest.raises(InputError, match="positive number of seconds"):
        primitive_plot(GRASP, done="grasped", within=within)
