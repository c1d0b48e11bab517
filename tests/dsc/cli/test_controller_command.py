"""Command `dsc controller`: files in both languages, the queue, and refused plots that leave the old file."""

import pytest
from controller_times import LINE_FOLLOWER
from typer.testing import CliRunner

from dsc.controllers import build_controller
from dsc.text.plot_files import load_plot
from knowledge_base.errors import InputError
from planning.cli.command import app


def build(*words):
    return CliRunner().invoke(app, ["controller", "build", *map(str, words)])


@pytest.mark.parametrize("target", ["python", "c99"])
def test_a_file_in_each_language(target, tmp_path):
    out = tmp_path / "controller"
    assert build(LINE_FOLLOWER, "--target", target, "--out", out, "--queue", 3).exit_code == 0
    assert out.read_text() == build_controller(load_plot(LINE_FOLLOWER), target, 3)
    assert build(LINE_FOLLOWER, "--target", target, "--queue", 3).stdout == out.read_text()


def test_a_refused_plot_and_the_old_file(tmp_path):
    chart, out = tmp_path / "p.yaml", tmp_path / "p.c"
    chart.write_text("plot: p\nstates:\n  a: {use: other}\n  b: {always: {to: a, when: (p)}}\n")
    out.write_text("old")
    result = build(chart, "--target", "c99", "--out", out)
    assert isinstance(result.exception, InputError)
    assert [line.split(":")[1] for line in str(result.exception).splitlines()] == ["3", "4"]
    assert out.read_text() == "old"


def test_an_scxml_chart(tmp_path):
    chart = tmp_path / "chart.scxml"
    chart.write_text(
        '<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0" initial="a" name="lamp">'
        '<state id="a"><transition event="go" target="b"/></state><state id="b"/></scxml>'
    )
    result = build(chart, "--target", "python")
    assert result.exit_code == 0
    assert "    GO = 3" in result.stdout
