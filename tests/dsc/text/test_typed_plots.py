"""Typed functions for plots, as `dsc plot types` prints them (S2.11)."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Literal, get_args, get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from dsc import Library, PlotCall, Sequencer, parse_plot
from dsc.annotations import domain_type, type_class, type_of
from dsc.cli.plots import app
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.text.typed_plots import typed_plots
from knowledge_base import InputError, KnowledgeBase
from knowledge_base.world.schema import Schema

SCHEMA = Schema.parse("(define (domain d) (:types clean_item mug - item item room - object 2d-pose))")

COUNT = parse_plot("""
plot: count
about: |
  Count "mugs" in a room.

  Slowly.
parameters:
  mug: mug
  room: {type: room, default: hall}
  from: {type: number, default: 1, least: 0}
  how: {type: text, default: fast, among: [fast, slow]}
  pose: 2d-pose
outputs: {number: number, where: room}
states:
  s: {after: {seconds: 1, to: e, assign: {number: (+ ?from 1), where: ?room}}}
  e: {final: true}
""")
ODD = parse_plot("{plot: odd-one.b, outputs: {class: boolean}, states: {e: {final: true}}}")


def module(*plots, schema=SCHEMA):
    names: dict[str, object] = {"__name__": "plots"}
    exec(typed_plots(plots, schema), names)  # noqa: S102  # the text that is tested
    return SimpleNamespace(**names)


def test_a_function_takes_the_parameters_of_its_plot_and_leaves_defaults():
    made = module(COUNT)
    call = made.count(mug="m1", pose="p", from_=3)
    assert call == PlotCall("count", {"mug": "m1", "room": None, "from": 3, "how": None, "pose": "p"})
    assert call.arguments == {"mug": "m1", "from": 3, "pose": "p"}
    assert made.count.__doc__.splitlines()[0] == 'Count "mugs" in a room.'
    with pytest.raises(TypeError):
        made.count(mgu="m1", pose="p")


def test_annotations_name_the_types_of_the_domain_below_their_supertypes():
    made = module(COUNT)
    hints = get_type_hints(made.count, vars(made))
    assert [type_of(hints[name]) for name in ("mug", "room", "from_", "how")] == [
        "mug", "optional room", "optional number", "optional fast | slow",
    ]  # fmt: skip
    assert made.Mug.__supertype__ is made.Item
    assert get_args(get_args(hints["how"])[0]) == ("fast", "slow")
    assert made.T2dPose.__metadata__ == ("2d-pose",) or type_of(made.T2dPose) == "2d-pose"


def test_names_that_python_does_not_permit_are_changed():
    made = module(ODD)
    assert made.odd_one_b() == PlotCall("odd-one.b", {})
    assert made.OddOneBOutputs.__annotations__.keys() == {"class"}


def test_without_a_domain_types_are_unrelated():
    assert module(COUNT, schema=None).Mug.__supertype__ is str


@given(st.from_regex(r"[a-z][a-z0-9_-]{0,12}", fullmatch=True))
def test_the_class_of_a_type_has_the_type_again_or_is_annotated(name):
    made = type_class(name)
    assert made.isidentifier()
    plot = parse_plot(f"{{plot: p, parameters: {{x: {name}}}, states: {{e: {{final: true}}}}}}")
    if name not in {"number", "text", "boolean", "symbol", "object"}:
        assert type_of(getattr(module(plot, schema=None), made)) == name
        assert domain_type(made) == name or "Annotated" in typed_plots([plot])


def test_a_call_is_run_with_its_arguments_and_has_outputs():
    knowledge = KnowledgeBase(SCHEMA)
    with knowledge.transaction(author="map") as world:
        for name, kind in {"m1": "mug", "hall": "room", "p": "2d-pose"}.items():
            world.add_node(name, kind)

    async def run(call):
        return await Sequencer(Library([COUNT]), knowledge, [], LoopClock()).run(call)

    end = run_simulated(run(module(COUNT).count(mug="m1", pose="p", from_=3)))
    assert end.outputs == {"number": 4, "where": "hall"}
    with pytest.raises(InputError, match="there is no object 'm2'"):
        run_simulated(run(module(COUNT).count(mug="m2", pose="p")))


def test_the_command_prints_the_module_for_files_and_folders(tmp_path):
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots" / "count.yaml").write_text(TEXT)
    (tmp_path / "domain.pddl").write_text("(define (domain d) (:types mug - item room 2d-pose))")
    for source in (tmp_path / "plots", tmp_path / "plots" / "count.yaml"):
        done = CliRunner().invoke(app, ["types", str(source)])
        assert done.exit_code == 0, done.output
        assert 'Mug = NewType("Mug", Item)' in done.output
        assert "def count(" in done.output


TEXT = "{plot: count, parameters: {mug: mug}, states: {e: {final: true}}}"


FIND = parse_plot("""
plot: find
types: {spot: {pose: geometry, label: optional text}, find: {item: mug, spots: list of spot}}
parameters: {hand: optional left | right, near: {type: map of number, default: {}}, few: integer, plan: plot}
outputs: {finds: list of find, rest: any}
states: {e: {final: true}}
""")


def test_lists_records_and_choices_have_annotations():
    made = module(FIND)
    hints = get_type_hints(made.find, vars(made))
    assert hints["hand"] == Literal["left", "right"] | None
    assert (hints["near"], hints["few"], hints["plan"]) == (dict[str, float] | None, int, dict[str, Any])
    assert made.FindOutputs.__annotations__["finds"].__forward_arg__ == "list[Find]"
    assert made.Spot.__optional_keys__ == {"label"} or "NotRequired" in str(made.Spot.__annotations__["label"])
    assert made.find(few=2, plan={}).arguments == {"few": 2, "plan": {}}
