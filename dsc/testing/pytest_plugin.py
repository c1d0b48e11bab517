"""Plugin for pytest, enabled by `pytest_plugins = ["dsc.testing.pytest_plugin"]`.

With `dsc_plots = FOLDER ...` in pytest's settings, the fixture `plot_coverage` counts the steps that tests add during
the session. The summary ends with the coverage report. Each worker of pytest-xdist counts separately, and prints no
report.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from dsc.testing.coverage import Coverage
from dsc.text.plot_files import load_library

_COVERAGE = pytest.StashKey[Coverage]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the setting `dsc_plots`."""
    parser.addini("dsc_plots", "folders of the plots that plot_coverage covers", type="paths", default=[])


@pytest.fixture(scope="session")
def plot_coverage(pytestconfig: pytest.Config) -> Coverage:
    """Return one `Coverage` of all plots in the folders of `dsc_plots`, for the whole session."""
    folders: list[Path] = pytestconfig.getini("dsc_plots")
    if not folders:
        raise pytest.UsageError("plot_coverage needs the setting `dsc_plots`: the folders with the plots")
    return pytestconfig.stash.setdefault(_COVERAGE, Coverage(plot for each in folders for plot in load_library(each)))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Print the coverage report, if any test used the fixture."""
    coverage = config.stash.get(_COVERAGE, None)
    if coverage is not None:
        terminalreporter.section("plot coverage")
        terminalreporter.write_line(coverage.report())
