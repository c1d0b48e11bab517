"""Bundles of components, plots and domains, put together to robot programs."""

from __future__ import annotations

import json
from importlib.metadata import EntryPoint
from typing import Annotated

import pytest
from typer.testing import CliRunner

from dsc import Component, Outcome, SkillCall, parse_plot, primitive_plot, skill
from knowledge_base import Delta, InputError, UnknownNameError, fact
from planning import Bundle, PlanningDomain, Robot
from planning.cli.command import app
from planning.robot import bundles
from planning.robot.bundles import gathered, installed
from planning.robot.targets import bundle_at

Item = Annotated[str, "item"]


class Grasped(Outcome): ...


class Arm(Component):
    name = "arm"
    domain = """(define (domain arm) (:types item) (:predicates (holding ?item - item))
      (:action grasp :parameters (?item - item) :effect (holding ?item)))"""

    @skill
    async def grasp(self, call: SkillCall, item: Item) -> Grasped:
        return Grasped(observed=Delta(added=(fact("holding", item),)))


HANDLING = Bundle(
    "handling", (primitive_plot(Arm().skills()["grasp"], done="grasped", implements="grasp"),), lambda: [Arm()]
)
FETCH = """
plot: fetch
parameters: {item: item}
states:
  get: {dynamic: [], goal: (holding ?item), on: {done: end, no_plan: end, gave_up: end}}
  end: {final: true}
"""
TASKS = Bundle("tasks", (parse_plot(FETCH),), needs=("handling",), about="fetch things")


def points(monkeypatch, **found):
    """As if packages with these bundles were installed."""

    class Point(EntryPoint):
        def load(self):
            made = found[self.name]
            if isinstance(made, Exception):
                raise made
            return made

    made = [Point(name=name, value=f"robots:{name}", group=bundles.GROUP) for name in found]
    monkeypatch.setattr(bundles, "entry_points", lambda group: made if group == bundles.GROUP else [])


def test_a_program_of_bundles_has_what_they_need(monkeypatch):
    points(monkeypatch, handling=HANDLING, tasks=lambda: TASKS)
    with Robot.of_bundles(["tasks"], clock="simulated") as robot:
        robot.knowledge.apply(Delta(nodes={"cup": "item"}), "me")
        assert robot.run("fetch", {"item": "cup"}).reached
        assert robot.knowledge.ask("(holding cup)")


def test_each_program_has_components_of_its_own():
    programs = [Robot.of_bundles([HANDLING], clock="simulated") for _ in range(2)]
    assert programs[0].components[0] is not programs[1].components[0]


def test_a_needed_bundle_comes_first_and_only_once():
    one, two = Bundle("one", needs=("two",)), Bundle("two", needs=("one",))
    there = {"handling": HANDLING, "one": one, "two": two}
    assert [bundle.name for bundle in gathered([TASKS, "handling", "one"], there)] == [
        "handling",
        "tasks",
        "two",
        "one",
    ]


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        (["hamdling"], "there is no bundle 'hamdling'; did you mean 'handling'?"),
        ([Bundle("task", needs=("handeling",))], "there is no bundle 'handeling', which 'task' needs; did you mean"),
    ],
)
def test_a_bundle_that_is_not_there_is_named_with_who_needs_it(wanted, said):
    with pytest.raises(UnknownNameError) as error:
        gathered(wanted, {"handling": HANDLING})
    assert said in str(error.value)


def test_a_value_that_is_no_bundle_is_refused():
    with pytest.raises(InputError, match="a bundle is a Bundle or the name of an installed one, not 5"):
        gathered([5], {})  # type: ignore[list-item]


def test_bundles_that_contradict_each_other_are_named():
    other = Bundle("other", (parse_plot(FETCH.replace("item: item", "item: object")),), lambda: [Arm()])
    with pytest.raises(InputError, match="the bundles 'tasks' and 'other' have different plots 'fetch'"):
        Robot.of_bundles([TASKS, HANDLING, other], clock="simulated")
    with pytest.raises(InputError, match="the bundles 'handling' and 'more' both have a component 'arm'"):
        Robot.of_bundles([HANDLING, Bundle("more", components=lambda: [Arm()])], clock="simulated")
    with pytest.raises(InputError, match="two bundles are named 'handling'"):
        gathered([HANDLING, Bundle("handling")])


def test_a_folder_is_read_with_its_mistakes_named(tmp_path):
    with pytest.raises(InputError, match="a bundle has plots/"):
        Bundle.in_folder(tmp_path)
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots" / "fetch.yaml").write_text(FETCH)
    (tmp_path / "domain.pddl").write_text("(define (domain d) (:types item))")
    read = Bundle.in_folder(tmp_path, name="tasks", needs=("handling",))
    assert (read.plots, read.needs) == (TASKS.plots, TASKS.needs)
    assert isinstance(read.domain, PlanningDomain)
    (tmp_path / "plots" / "fetch.yaml").write_text("plot: fetch\nstates: 5")
    with pytest.raises(InputError, match=r"fetch\.yaml:2"):
        Bundle.in_folder(tmp_path)


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (
            ImportError("no module named robots"),
            "the bundle 'odd' of 'robots:odd' cannot be loaded: ImportError: no module",
        ),
        (5, "the entry point 'odd' of 'robots:odd' leads to 5, not to a Bundle"),
    ],
)
def test_an_installed_one_that_is_wrong_is_named_and_stops_no_other(monkeypatch, found, said):
    points(monkeypatch, odd=found, handling=HANDLING, tasks=TASKS)
    assert list(installed()) == ["handling", "tasks"]
    assert gathered(["tasks"]) == (HANDLING, TASKS)
    for ask in (installed().require, bundle_at, lambda name: gathered([name])):
        with pytest.raises(InputError, match=said):
            ask("odd")
    shown = CliRunner().invoke(app, ["bundles"])
    assert [line.split()[0] for line in shown.stdout.splitlines()] == ["handling", "tasks"]
    assert said in shown.stderr


def test_two_packages_with_bundles_of_one_name_are_named(monkeypatch):
    points(monkeypatch, handling=HANDLING, more=Bundle("handling"))
    assert not installed()
    with pytest.raises(InputError, match="two bundles are named 'handling': that of 'robots:handling' and of"):
        bundle_at("handling")


def test_primitive_plots_use_components_and_abstract_ones_plots_alone():
    assert (HANDLING.primitive, HANDLING.abstract) == (("grasp",), ())
    assert (TASKS.primitive, TASKS.abstract) == ((), ("fetch",))


def test_the_command_lists_what_is_installed(monkeypatch):
    points(monkeypatch, handling=HANDLING, tasks=TASKS)
    listed = CliRunner().invoke(app, ["bundles"]).stdout
    assert listed == "handling  plots: 1 primitive, 0 abstract\ntasks     fetch things\n"
    shown = CliRunner().invoke(app, ["bundles", "handling"]).stdout
    assert shown == "handling\ncomponent arm: grasp\nprimitive plots: grasp\nplanning actions: grasp\n"
    said = json.loads(CliRunner().invoke(app, ["bundles", "tasks", "--json"]).stdout)
    assert said == {
        "name": "tasks", "about": "fetch things", "needs": ["handling"], "components": {}, "primitive": [],
        "abstract": ["fetch"], "actions": [],
    }  # fmt: skip


def test_the_table_is_an_installed_bundle():
    assert "clean_up_table" in [plot.name for plot in installed()["clean-up-table"].plots]


def test_failures_may_be_any_collection_of_outcomes_but_no_text():
    assert set(Bundle("mine", failures=["jammed", "stuck"]).failures) == {"jammed", "stuck"}
    with pytest.raises(InputError, match="failures are a set of outcomes, not the text 'jammed'"):
        Bundle("mine", failures="jammed")


@pytest.mark.parametrize("one", ["handling", Bundle("handling")])
def test_one_bundle_is_not_a_list_of_bundles(one):
    with pytest.raises(InputError, match=r"the bundles are a list, e\.g\. \['handling'\], not one bundle"):
        Robot.of_bundles(one)
