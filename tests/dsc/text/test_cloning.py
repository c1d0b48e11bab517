"""Plots cloned for another robot with all that they depend on (S2.10)."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from dsc import Library, load_plot, parse_plot
from dsc.cli.plots import app
from dsc.text.cloning import clone_files, cloned, cloned_profile
from dsc.text.profiles import load_profile, parse_profile, profile_to_yaml
from knowledge_base import InputError
from knowledge_base.errors import SchemaError, UnknownNameError

PLACE = """# puts things down
plot: place
parameters: {thing: item}
states:
  look: {use: look, with: {thing: ?thing}, on: {done: put}}   # where it stands
  put:
    dynamic:
      - "put"
      - 'drop'
    on: {done: over, no_candidate: over}
  over: {final: true}
rules:
  - on: lost
    do: {use: look, with: {thing: ?thing}, then: retry}
handlers:
  - {on: bell, listen: {trigger: door.bell}, do: {use: greet}}
"""
LOOK = "plot: look\nparameters: {thing: item}\nemits: {lost: }\nstates: {turn: {use: greet, on: {done: e}}, e: {final: true}}\n"
PUT = "plot: put\nimplements: put-down   # the usual way\nwhen: (near)\nstates: {e: {final: true}}\n"
DROP = "plot: drop\nparameters: {height: {type: number, default: 1, most: 1000}}\nstates: {e: {final: true}}\n"
GREET = "plot: greet\nstates: {e: {final: true}}\n"
LIFT = "plot: lift\nimplements: lift\nstates: {e: {final: true}}\n"
GOAL = "plot: tidy\nstates: {s: {goal: (tidy), on: {done: e, no_plan: e, gave_up: e}}, e: {final: true}}\n"
ALL = {"place": PLACE, "look": LOOK, "put": PUT, "drop": DROP, "greet": GREET, "lift": LIFT, "tidy": GOAL}


def library(*names):
    return Library(parse_plot(ALL[name], f"{name}.yaml") for name in names or ALL)


def test_all_that_a_plot_depends_on_is_cloned_and_used():
    plots = library()
    clones = {one.name: one for one in cloned(plots.plot("place"), plots, "b_")}
    assert list(clones) == ["b_place", "b_look", "b_put", "b_drop", "b_greet"]
    assert clones["b_place"].uses() == {"b_look", "b_put", "b_drop", "b_greet"}
    assert clones["b_look"].uses() == {"b_greet"}


def test_beside_their_originals_clones_do_not_carry_out_planning_actions():
    plots = library()
    clones = Library([*plots, *cloned(plots.plot("place"), plots, "b_")])
    assert [one.name for one in clones.implementing("put-down")] == ["put"]
    assert clones.plot("b_put").when == plots.plot("put").when


def test_apart_they_do_and_a_goal_depends_on_all_that_carry_out_actions():
    plots = library()
    clones = Library(cloned(plots.plot("tidy"), plots, "b_", made=Library()))
    assert {one.name for one in clones} == {"b_tidy", "b_put", "b_lift"}
    assert [one.name for one in clones.implementing("put-down")] == ["b_put"]


def test_a_clone_that_was_made_before_is_used_as_it_is():
    plots = library()
    adapted = parse_plot("plot: b_look\nparameters: {thing: item}\nstates: {e: {final: true}}")
    clones = cloned(plots.plot("place"), plots, "b_", made=Library([adapted]))
    assert "b_look" not in {one.name for one in clones}
    assert "b_look" in clones[0].uses()


def test_a_clone_that_does_not_fit_any_more_is_named_with_the_reason():
    plots = library()
    adapted = parse_plot("plot: b_look\nstates: {e: {final: true}}", "b_look.yaml")
    with pytest.raises(
        SchemaError, match=r"b_look\.yaml:1:1: 'b_look' cannot replace 'look': it lacks its parameter 'thing'"
    ):
        cloned(plots.plot("place"), plots, "b_", made=Library([adapted]))


def test_a_plot_that_is_not_there_is_named():
    plots = library("place", "look")
    with pytest.raises(UnknownNameError, match="there is no plot 'put'"):
        cloned(plots.plot("place"), plots, "b_")


def test_profile_values_of_originals_apply_to_their_clones():
    profile = parse_profile(
        "profile: sim\nrobot: r\nplots: {look: {height: 900}, other: {height: 1}}\ndevices: {look: {left: lidar}}"
    )
    clone = cloned_profile(profile, "b_", {"look"})
    assert (clone.name, clone.robot) == ("b_sim", "r")
    assert clone.plots == {"b_look": {"height": 900}, "other": {"height": 1}}
    assert clone.devices == {"b_look": {"left": "lidar"}}
    assert parse_profile(profile_to_yaml(clone)).digest == clone.digest


@pytest.fixture
def folder(tmp_path):
    for name, text in ALL.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    (tmp_path / "sim.yaml").write_text("profile: sim\nplots: {drop: {height: 900}}\n")
    return tmp_path


def dsc(*arguments):
    return CliRunner().invoke(app, [str(one) for one in arguments])


def test_files_keep_their_comments_and_layout(folder):
    dsc("clone", folder / "place.yaml", "--prefix", "b_", "--into", folder / "b", "--profile", folder / "sim.yaml")
    made = (folder / "b" / "b_place.yaml").read_text()
    assert made == PLACE.replace("plot: place", "plot: b_place").replace("use: look", "use: b_look").replace(
        '"put"', '"b_put"'
    ).replace("'drop'", "'b_drop'").replace("use: greet", "use: b_greet")
    assert load_profile(folder / "b" / "b_sim.yaml").plots == {"b_drop": {"height": 900}}
    assert (folder / "b" / "b_put.yaml").read_text() == PUT.replace("plot: put", "plot: b_put")


@pytest.mark.parametrize(
    ("value", "said"),
    [("height: 9000", "'drop.height' is 1000 or less; found 9000"), ("hight: 9", "did you mean 'height'")],
)
def test_a_profile_that_does_not_fit_is_not_cloned(folder, value, said):
    (folder / "sim.yaml").write_text(f"profile: sim\nplots: {{drop: {{{value}}}}}\n")
    result = dsc("clone", folder / "place.yaml", "--prefix", "b_", "--profile", folder / "sim.yaml")
    assert said in str(result.exception)
    assert not list(folder.glob("b_*"))


def test_files_beside_the_originals_lose_only_the_planning_action(folder):
    dsc("clone", folder / "place.yaml", "--prefix", "b_")
    assert (folder / "b_put.yaml").read_text() == "plot: b_put\nwhen: (near)\nstates: {e: {final: true}}\n"
    assert (folder / "put.yaml").read_text() == PUT


def test_cloned_again_nothing_is_written_and_that_is_said(folder):
    dsc("clone", folder / "look.yaml", "--prefix", "b_")
    (folder / "b_greet.yaml").write_text("plot: b_greet\nabout: adapted\nstates: {e: {final: true}}\n")
    before = {file: file.read_text() for file in folder.iterdir()}
    result = dsc("clone", folder / "look.yaml", "--prefix", "b_")
    assert (result.exit_code, result.output.count("which was made before")) == (0, 2)
    assert {file: file.read_text() for file in folder.iterdir()} == before
    dsc("clone", folder / "place.yaml", "--prefix", "b_")
    assert load_plot(folder / "b_greet.yaml").about == "adapted"
    assert "b_greet" in load_plot(folder / "b_place.yaml").uses()


def test_a_file_that_holds_no_clone_is_not_overwritten(folder):
    (folder / "b_look.yaml").write_text("something else")
    with pytest.raises(InputError, match=r"b_look\.yaml: the file is there already, and holds no clone"):
        clone_files(folder / "look.yaml", "b_")
    assert not (folder / "b_greet.yaml").exists()


@pytest.mark.parametrize("prefix", ["1b", "", "a b", "../"])
def test_a_prefix_that_makes_no_name_is_refused(folder, prefix):
    with pytest.raises(InputError, match="no name begins with"):
        clone_files(folder / "look.yaml", prefix)
