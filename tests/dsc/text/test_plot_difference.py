"""What is different between two plots is said and drawn."""

from __future__ import annotations

from dsc_charts import plot
from typer.testing import CliRunner

from dsc.cli.plots import app
from dsc.text.plot_difference import differences, draw_difference

OLD = """
plot: p
parameters: {table: object}
emits: {gone: {}}
states:
  a: {on: {go: b, stop: w}, entry: {trigger: arm.look}}
  b: {always: w}
  w: {states: {x: {always: y}, y: {final: true}}, on: {done: e}}
  e: {final: true, emit: gone}
"""
NEW = """
plot: p
parameters: {table: object, speed: number}
emits: {gone: {}}
states:
  a: {on: {go: w, stop: w}, entry: {trigger: arm.look}}
  w: {states: {x: {always: z}, z: {always: y}, y: {final: true}}, on: {done: e}}
  e: {final: true, emit: gone}
"""


def test_the_same_plot_is_no_difference() -> None:
    assert differences(plot(OLD), plot(OLD)) == []


def test_the_interface_comes_first_then_states_inner_ones_for_themselves() -> None:
    assert [str(d) for d in differences(plot(OLD), plot(NEW))] == [
        "+ parameter speed",
        "~ state a: on",
        "- state b",
        "~ state x: always",
        "+ state z",
    ]


def test_a_state_that_is_somewhere_else_has_changed() -> None:
    moved = NEW.replace("  w: {states: {x: {always: z}, z: {always: y}, y: {final: true}}, on: {done: e}}\n",
                        "  w: {states: {x: {always: y}, y: {final: true}}, on: {done: z}}\n  z: {always: e}\n")  # fmt: skip
    assert "~ state z: always, place" in [str(d) for d in differences(plot(NEW), plot(moved))]


def test_both_are_drawn_with_their_marks() -> None:
    before, after = draw_difference(plot(OLD), plot(NEW))
    assert [before.count(f'class="{mark}"') for mark in ("removed", "changed", "added")] == [1, 2, 0]
    assert [after.count(f'class="{mark}"') for mark in ("removed", "changed", "added")] == [0, 2, 1]


def test_the_command_says_by_its_status_whether_there_is_a_difference(tmp_path) -> None:
    old, new, svg = tmp_path / "old.yaml", tmp_path / "new.yaml", tmp_path / "out.svg"
    old.write_text(OLD, encoding="utf-8")
    new.write_text(NEW, encoding="utf-8")
    same = CliRunner().invoke(app, ["diff", str(old), str(old)])
    other = CliRunner().invoke(app, ["diff", str(old), str(new), "--svg", str(svg)])
    assert (same.exit_code, same.output) == (0, "")
    assert (other.exit_code, other.output.splitlines()[0]) == (1, "+ parameter speed")
    assert svg.read_text(encoding="utf-8").count("<svg") == 3
