"""Types of data: which values they accept, in one check, in a run, through a store, and from another process (S2.21)."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, make_dataclass
from enum import Enum
from typing import Annotated, Any, Literal, NewType

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, Field
from typed_values import PLAIN, RECORDS, typed_values

from dsc import Component, Library, LoopClock, Outcome, Sequencer, SkillCall, parse_plot, skill
from dsc.annotations import type_of
from dsc.data_types import DataType, data_type, objects_in
from dsc.python_values import builder, plain_value
from dsc.runs.archive import records_of
from dsc.runs.store import RunStore
from dsc.sequencer.clock import run_simulated
from dsc.wire import Host, RemoteComponent
from dsc.wire.endpoint import LocalTransport
from knowledge_base import InputError, KnowledgeBase, Schema

SCHEMA = Schema.parse("(define (domain d) (:types item))")
TYPES = """
types:
  spot: {x: number, label: optional text}
  find: {item: text, at: spot, tags: list of text}
"""


def accepts(text: str, value: Any) -> bool:
    try:
        data_type(text).check("it", value, RECORDS)
    except InputError:
        return False
    return True


@given(typed_values(fits=True))
def test_a_value_of_the_type_is_accepted_and_equal_after_json(drawn):
    text, value = drawn
    checked = data_type(text).check("it", value, RECORDS)
    assert checked == value
    assert data_type(text).check("it", json.loads(json.dumps(checked)), RECORDS) == checked


@given(typed_values(fits=False))
def test_a_value_that_differs_in_one_part_is_refused(drawn):
    text, value = drawn
    with pytest.raises(InputError, match="it "):
        data_type(text).check("it", value, RECORDS)


@given(typed_values(fits=True))
def test_a_type_is_read_from_its_text(drawn):
    kind = data_type(drawn[0])
    assert data_type(str(kind)) == kind


_words = st.text(st.sampled_from("ab |\"\\\n\r\t'0.-é"), min_size=1, max_size=6) | st.sampled_from(
    ["optional", "true", "1", "1e3", "list of x"]
)


@given(
    st.lists(
        _words | st.integers() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False),
        min_size=1,
        max_size=4,
    )
)
def test_each_value_of_a_choice_is_read_from_the_text_of_its_type(values):
    kind = DataType("choice", values=tuple(values))
    for text in (str(kind), f"list of {kind}", str(data_type(f"optional {kind}"))):
        found = data_type(text)
        read = (found.inner or found).values
        assert [(type(one), one) for one in read] == [(type(one), one) for one in values]


@given(st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(2**53), 2**53))
def test_a_bound_is_read_from_the_text_of_its_type(bound):
    kind = DataType("number", least=float(bound))
    assert data_type(str(kind)) == kind
    assert kind.check("it", bound) == bound


def test_a_quote_without_its_end_is_named():
    with pytest.raises(InputError, match="a quote has no end"):
        data_type('"left | right')


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("list[item]", "write `list of item`"),
        ("dict[str, number]", "write `map of number`"),
        ("List<item>", "write `list of item`"),
        ("item?", "write `optional item`"),
        ("list item", "write `list of item`"),
        ("Optional[text]", "write `optional text`"),
        ("two words", "a type is a name"),
        ("number from low", "a bound is a number"),
        ("number from 3 to 1", "has no values"),
        ("number to inf", "a bound is a finite number"),
        ("number from nan", "a bound is a finite number"),
        ("list of " * 5_000 + "text", "at most 64 levels"),
        ("optional " * 5_000 + "text", "at most 64 levels"),
        ("", "is not a type"),
    ],
)
def test_a_text_that_is_no_type_is_answered_with_the_nearest_form(text, said):
    with pytest.raises(InputError) as caught:
        data_type(text)
    assert said in str(caught.value)


def test_the_message_names_the_part_that_differs():
    value = [{"item": "a", "at": {"x": 1}, "tags": []}, {"item": "a", "at": {"x": "far"}, "tags": []}]
    with pytest.raises(InputError) as caught:
        data_type("list of find").check("'p.found'", value, RECORDS)
    assert str(caught.value) == "'p.found' at 1.at.x is a finite number, not 'far'"


def test_a_list_that_is_too_long_is_refused():
    with pytest.raises(InputError, match="10001 elements"):
        data_type("list of number").check("'x'", [1] * 10_001)


def test_a_value_that_is_too_deep_is_refused():
    value: dict[str, Any] = {"inside": []}
    for _ in range(400):
        value = {"inside": [value]}
    with pytest.raises(InputError, match="more than 64 levels"):
        data_type("tree").check("'x'", value, {"tree": {"inside": "list of tree"}})


def test_the_objects_inside_of_a_value_are_found():
    records = {"find": {"item": "item", "near": "optional list of item"}}
    value = [{"item": "a", "near": ["b", "c"]}, {"item": "d"}]
    found = list(objects_in(data_type("list of find"), value, records))
    assert found == [
        ("0.item", "a", "item"),
        ("0.near.0", "b", "item"),
        ("0.near.1", "c", "item"),
        ("1.item", "d", "item"),
    ]


# -- one verdict in all places -------------------------------------------------------------------------------


def mouth(text: str, value: Any) -> Component:
    """A component whose skill says the value as an attribute of the type, and whose other skill takes it."""

    class Said(Outcome):
        what: Annotated[Any, text]

    class Heard(Outcome): ...

    class Mouth(Component):
        name = "mouth"

        @skill
        async def say(self, call: SkillCall) -> Said:
            return Said(what=value)

        @skill
        async def hear(self, call: SkillCall, what: Annotated[Any, text]) -> Heard:
            assert what == value
            return Heard()

    return Mouth()


def said(text: str, component: Component, *, store: Any = None, remote: bool = False) -> tuple[bool, Any]:
    """Return whether the run reached its end, and the value that went from one skill through a plot to the other."""
    plot = parse_plot(f"""
plot: p
{TYPES}
outputs: {{kept: '{text}'}}
states:
  a:
    entry: {{trigger: mouth.say}}
    on: {{said: {{to: b, assign: {{kept: ?event.what}}}}}}
  b:
    entry: {{trigger: mouth.hear, with: {{what: ?kept}}}}
    on: {{heard: over}}
  over: {{final: true}}
""")

    async def main() -> tuple[bool, Any]:
        knowledge = KnowledgeBase(SCHEMA) if store is None else KnowledgeBase.open(SCHEMA, store)
        host, used = None, component
        if remote:
            host = Host(component, transport := LocalTransport(), LoopClock())
            used = await RemoteComponent.connect("mouth", transport)
        run = None if store is None else RunStore(knowledge, store, {})
        sequencer = Sequencer(Library([plot]), knowledge, [used], LoopClock(), store=run)
        end = await sequencer.run("p")
        if host is not None:
            await host.close()
        if run is not None:
            knowledge.close()
            return end.finished, records_of(store)[-1][-1].data["outputs"]["kept"]
        return end.finished, end.outputs.get("kept")

    return run_simulated(main())


@settings(max_examples=40)
@given(typed_values(fits=True) | typed_values(fits=False), st.booleans())
def test_an_outcome_has_the_same_verdict_here_and_in_another_process(drawn, remote):
    text, value = drawn
    fits = accepts(text, value)
    finished, kept = said(text, mouth(text, value), remote=remote)
    assert finished == fits
    assert not fits or kept == value


@settings(max_examples=15)
@given(drawn=typed_values(fits=True))
def test_a_value_is_equal_in_a_kept_run(tmp_path_factory, drawn):
    text, value = drawn
    store = tmp_path_factory.mktemp("kept") / "run.kb"
    finished, kept = said(text, mouth(text, value), store=store)
    assert (finished, kept) == (True, value)


@settings(max_examples=60)
@given(typed_values(fits=True) | typed_values(fits=False))
def test_an_argument_of_a_run_has_the_same_verdict(drawn):
    text, value = drawn
    plot = parse_plot(f"""
plot: p
{TYPES}
parameters: {{x: '{text}'}}
outputs: {{y: {{type: '{text}', initial: ?x}}}}
states:
  a: {{on: {{done: over}}}}
  over: {{final: true}}
""")

    async def main() -> Any:
        sequencer = Sequencer(Library([plot]), KnowledgeBase(SCHEMA), [], LoopClock())
        try:
            return (await sequencer.run("p", {"x": value})).outputs["y"]
        except InputError:
            return InputError

    found = run_simulated(main())
    assert (found is not InputError) == accepts(text, value)
    assert found is InputError or found == value


def test_each_form_of_type_is_tested():
    kinds = {data_type(text).kind for text in PLAIN} | {"list", "map", "optional"}
    assert kinds == {"number", "integer", "boolean", "name", "geometry", "choice", "list", "map", "optional"}


# -- annotations ---------------------------------------------------------------------------------------------


class Colour(Enum):
    RED = "red"
    BLUE = "blue"


@dataclass
class Leaf:
    colour: Colour
    veins: list[float] = field(default_factory=list)


class Branch(BaseModel):
    leaves: list[Leaf]
    parts: dict[str, Branch] = {}
    owner: str | None = None


@pytest.mark.parametrize(
    ("annotation", "text"),
    [
        (int, "integer"),
        (float, "number"),
        (list[str], "list of text"),
        (list, "list of any"),
        (list[Any], "list of any"),
        (dict[str, list[int]], "map of list of integer"),
        (dict[int, str], None),
        (str | None, "optional text"),
        (list[str] | None, "optional list of text"),
        (int | str, None),
        (Literal["a", "b"], "a | b"),
        (Literal[1, 2] | None, "optional 1 | 2"),
        (Colour, "red | blue"),
        (NewType("CleanItem", str), "clean-item"),
        (Annotated[str, "list of item"], "list of item"),
        (Annotated[float, 3], "number"),
        (Leaf, "leaf"),
        (list[Branch], "list of branch"),
        (tuple[float, ...], None),
    ],
)
def test_an_annotation_has_a_type(annotation, text):
    assert type_of(annotation) == text


def test_classes_of_records_have_fields_and_values():
    records: dict[str, dict[str, str | None]] = {}
    assert type_of(Branch, records) == "branch"
    leaf = {"colour": "red | blue", "veins": "optional list of number"}
    branch = {"leaves": "list of leaf", "parts": "optional map of branch", "owner": "optional text"}
    assert records == {"leaf": leaf, "branch": branch}
    value = Branch(leaves=[Leaf(Colour.RED)], parts={"top": Branch(leaves=[])}, owner="me")
    plain = data_type("branch").check("it", plain_value(value), records)
    assert plain["parts"]["top"] == {"leaves": [], "parts": {}}
    build = builder(Branch)
    assert build is not None
    assert build(json.loads(json.dumps(plain))) == value
    assert builder(list[float] | None) is None


def test_the_checks_of_a_class_refuse_a_value():
    class Age(BaseModel):
        years: int = Field(ge=0)

    build = builder(list[Age])
    assert build is not None
    with pytest.raises(InputError, match="greater than or equal to 0"):
        build([{"years": -1}])


def test_a_field_that_plots_cannot_read_is_refused():
    @dataclass
    class Wheel:
        maxSpeed: float  # noqa: N815

    with pytest.raises(InputError, match="write 'max_speed'"):
        type_of(Wheel)


def test_two_classes_with_one_name_and_other_fields_are_refused():
    def made(kind: type) -> type:
        return make_dataclass("Spot", [("x", kind)])

    records: dict[str, dict[str, str | None]] = {}
    type_of(made(float), records)
    with pytest.raises(InputError, match="two classes of records are named 'spot'"):
        type_of(made(str), records)
