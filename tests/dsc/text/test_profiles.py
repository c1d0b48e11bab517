"""Profile files: read with places, brought to components and plots, refused as a whole if anything is wrong (S2.10)."""

from __future__ import annotations

import json
import re

import pytest
from dsc_base import Base
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

from dsc import Component, parse_plot
from dsc.cli.plots import app
from dsc.profiles import configure
from dsc.text.profiles import adapted, find_profile, parse_profile, profile_schema
from dsc.text.yaml import load_document
from knowledge_base import InputError

WAIT = parse_plot("""
plot: wait
parameters:
  seconds: {type: number, default: 10, least: 1, most: 60, changed_by: operator}
  times: {type: number, default: 1, changed_by: nobody}
  why: text
states: {e: {final: true}}
""")
GOOD = """profile: simulation
about: Everything is fast.
components:
  base: {port: none, speed: 0.9, mode: brisk}
plots:
  wait: {seconds: 1}
"""


def of(text):
    return parse_profile(text, "sim.yaml")


def test_a_profile_gives_components_and_plots_their_values():
    base, other = Base(), Component("other")
    configure([base, other], of(GOOD))
    assert base.parameters == {"speed": 0.9, "mode": "brisk", "port": "none", "wheels": 4, "light": False, "cycle": 2.0}
    (wait,) = adapted([WAIT], of(GOOD))
    assert wait.to_form()["parameters"]["seconds"]["default"] == 1
    assert WAIT.to_form()["parameters"]["seconds"]["default"] == 10


def test_without_a_profile_everything_is_as_it_was_built():
    other = Component("other")
    configure([other])
    assert other.parameters == {}
    assert adapted([WAIT]) == (WAIT,)


@pytest.mark.parametrize(
    ("components", "line", "said"),
    [
        ("bse: {port: a}", 3, "there is no component 'bse'; did you mean 'base'?"),
        ("base: {port: a, sped: 1}", 3, "has no parameter 'sped'; did you mean 'speed'?"),
        ("base: {port: a, speed: 9}", 3, "'base.speed' is from 0.1 to 1.5; found 9"),
        ("base: {port: a, mode: brisc}", 3, "one of calm, brisk; found brisc; did you mean 'brisk'?"),
        ("base: {port: a, wheels: 6}", 3, "'base.wheels' is not changed by profile, but by nobody"),
        ("base: {speed: 0.2}", 3, "'base.port' has no value: its builder leaves it to a profile"),
        ("base: {port: a, cycle: 0.1}", 3, "needs (<= ?speed (* 0.5 ?cycle)), but cycle is 0.1, speed is 0.5"),
    ],
)
def test_an_invalid_profile_is_refused_with_its_place_and_changes_no_parameter(components, line, said):
    base = Base()
    before = dict(base.parameters)
    with pytest.raises(InputError, match=re.escape(said)) as error:
        configure([base, Component("other")], of(f"profile: p\ncomponents:\n  {components}\n"))
    assert (error.value.place.source, error.value.place.line) == ("sim.yaml", line)
    assert base.parameters == before


def test_an_unbound_required_parameter_is_refused_without_a_profile_too():
    with pytest.raises(InputError, match=re.escape("'base.port' has no value")):
        configure([Base()])


@pytest.mark.parametrize(
    ("plots", "said"),
    [
        ("wiat: {seconds: 1}", "there is no plot 'wiat'; did you mean 'wait'?"),
        ("wait: {second: 1}", "plot 'wait' has no parameter 'second'; did you mean 'seconds'?"),
        ("wait: {seconds: long}", "'wait.seconds' is a number, from 1 to 60; found the text long"),
        ("wait: {seconds: 0.5}", "'wait.seconds' is from 1 to 60; found 0.5"),
        ("wait: {times: 3}", "'wait.times' is not changed by profile, but by nobody"),
        ("wait: {why: 3}", "'wait.why' is a text; found 3"),
    ],
)
def test_values_for_plots_fit_too(plots, said):
    with pytest.raises(InputError, match=re.escape(said)) as error:
        adapted([WAIT], of(f"profile: p\nplots:\n  {plots}\n"))
    assert error.value.place.line == 3


CHOOSING = """
plot: main
states:
  both:
    on: {done: over}
    regions:
      left: {states: {first: {dynamic: [quick, safe], on: {done: left_over, no_candidate: left_over}}, left_over: {final: true}}}
      right: {states: {wait: {after: {seconds: 1, to: right_over}}, right_over: {final: true}}}
  over: {final: true}
"""


def test_a_profile_changes_the_choice_of_a_dynamic_state_at_any_depth():
    plot = parse_plot(CHOOSING, "main.yaml")
    (changed,) = adapted([plot], of("profile: p\nchoose: {main: {first: utility}}\n"))
    assert changed.state("first").choose == "utility"
    assert plot.state("first").choose == "order"
    assert (
        changed.to_form() == parse_plot(CHOOSING.replace("[quick, safe],", "[quick, safe], choose: utility,")).to_form()
    )
    assert changed.digest != plot.digest


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("choose: {man: {first: cost}}", "sim.yaml:2:10: there is no plot 'man'; did you mean 'main'?"),
        (
            "choose: {main: {frst: cost}}",
            "sim.yaml:2:17: plot 'main' has no dynamic state 'frst'; did you mean 'first'?",
        ),
        ("choose: {main: {wait: cost}}", "sim.yaml:2:17: plot 'main' has no dynamic state 'wait'"),
        (
            "choose: {main: {first: best}}",
            "sim.yaml:2:17: it should be 'order', 'priority', 'utility', 'cost' or 'learned'; found 'best'",
        ),
    ],
)
def test_a_wrong_choice_in_a_profile_is_refused_with_its_place(text, said):
    with pytest.raises(InputError, match=re.escape(said)):
        adapted([parse_plot(CHOOSING, "main.yaml")], of(f"profile: p\n{text}\n"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("profile: p\nprofile: q\n", "sim.yaml:2:1: not readable as YAML: duplicate key"),
        ("profile: p\ncomponent: {}\n", "sim.yaml:2:1: unknown key 'component'; did you mean 'components'?"),
        ("components: {}\n", "the key 'profile' is missing"),
        (
            "profile: p\ncomponents: {base: {speed: [1]}}\n",
            "sim.yaml:2:21: a number, a text or a truth value was expected",
        ),
        ("profile: p\ncomponents: {base: {speed: .nan}}\n", "sim.yaml:2:21: a finite number was expected; found nan"),
        ("profile: p\nplots: {wait: {seconds: .inf}}\n", "sim.yaml:2:16: a finite number was expected; found inf"),
        ("profile: p\ncomponents: {base: fast}\n", "sim.yaml:2:14: a mapping of names was expected"),
    ],
)
def test_a_file_that_is_no_profile_is_refused_with_its_line(text, said):
    with pytest.raises(InputError, match=re.escape(said)):
        of(text)


def test_a_profile_is_found_by_name_or_file(tmp_path):
    (tmp_path / "sim.yaml").write_text(GOOD)
    assert find_profile("sim", tmp_path).name == "simulation"
    assert find_profile(str(tmp_path / "sim.yaml"), tmp_path / "nowhere").name == "simulation"
    with pytest.raises(InputError, match=r"there is no profile 'simm'.*did you mean 'sim'"):
        find_profile("simm", tmp_path)


def test_the_schema_says_what_the_reader_says():
    assert json.loads(CliRunner().invoke(app, ["schema", "--profile"]).output) == profile_schema()
    schema = Draft202012Validator(profile_schema())
    assert list(schema.iter_errors(load_document(GOOD).data)) == []
    for wrong in ("profile: p\ncomponent: {}\n", "profile: p\ncomponents: {base: {speed: [1]}}\n"):
        assert list(schema.iter_errors(load_document(wrong).data))


def test_a_plot_and_a_profile_are_told_apart(tmp_path):
    with pytest.raises(InputError, match=r"p\.yaml:1:1: this is a profile, not a plot"):
        parse_plot("profile: fast\n", "p.yaml")
    with pytest.raises(InputError, match=r"p\.yaml:1:1: this is a plot, not a profile"):
        parse_profile("plot: fast\n", "p.yaml")
