"""The plug-in as a user of pytest meets it: asked for, one coverage for the session, a report at the end."""

from __future__ import annotations

import subprocess
import sys

PLOT = "plot: p\nstates:\n  a: {on: {go: b, stop: b}}\n  b: {final: true}\n"
TESTS = """
from dsc import load_library
from dsc.testing import DryRun

def one_way(plot_coverage, event):
    run = DryRun(load_library("plots"), "p")
    run.send(event)
    plot_coverage.add(*run.steps)

def test_go(plot_coverage):
    one_way(plot_coverage, "go")
    assert plot_coverage.count("p", "transition") == (1, 2)

def test_stop(plot_coverage):
    one_way(plot_coverage, "stop")
    assert plot_coverage.ratio == 1

def test_nothing():
    pass
"""


def run_pytest(folder, *arguments, settings="dsc_plots = plots\n"):
    (folder / "plots").mkdir()
    (folder / "plots" / "p.yaml").write_text(PLOT)
    (folder / "pytest.ini").write_text(f"[pytest]\n{settings}")
    (folder / "conftest.py").write_text('pytest_plugins = ["dsc.testing.pytest_plugin"]\n')
    (folder / "test_p.py").write_text(TESTS)
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)


def test_tests_of_a_session_add_up_and_the_summary_has_the_report(tmp_path):
    done = run_pytest(tmp_path)
    assert done.returncode == 0, done.stdout
    assert "= plot coverage =" in done.stdout
    assert any(line.split() == ["p", "2", "of", "2", "2", "of", "2", "-"] for line in done.stdout.splitlines())


def test_a_session_without_selected_tests_reports_no_plot_coverage(tmp_path):
    assert "plot coverage" not in run_pytest(tmp_path, "-k", "nothing").stdout


def test_without_folders_it_says_what_is_missing(tmp_path):
    done = run_pytest(tmp_path, settings="")
    assert done.returncode != 0
    assert "plot_coverage needs the setting `dsc_plots`" in done.stdout
