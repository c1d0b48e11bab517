"""What a person pays before anything happens: `dsc --help` loads no engine, no store and no model library."""

import subprocess
import sys

import pytest

HEAVY = ("unified_planning", "up_pyperplan", "pyperplan", "networkx", "pydantic", "ruamel.yaml", "asyncio", "numpy")

PROBE = """
import sys
sys.argv = {argv!r}
from planning.cli.command import main
try:
    main()
except SystemExit:
    pass
print("LOADED", *[name for name in {heavy!r} if name in sys.modules])
"""


@pytest.mark.parametrize(
    "argv", [["dsc", "--help"], ["dsc", "run", "--help"], ["dsc", "plot", "--help"], ["dsc", "kb", "--help"],
             ["dsc", "plan", "--help"]], ids=" ".join,
)  # fmt: skip
def test_help_is_light(argv):
    # Typer itself turns to pydantic for the parameters of a command; the help of `dsc` has none.
    heavy = HEAVY if argv == ["dsc", "--help"] else [name for name in HEAVY if name != "pydantic"]
    probe = PROBE.format(argv=argv, heavy=heavy)
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.splitlines()[-1] == "LOADED"
    assert "Usage" in done.stdout


def test_importing_the_packages_loads_nothing_heavy():
    code = (
        "import sys, dsc, dsc.testing, planning, knowledge_base, domains\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "[]"


def test_a_run_without_the_libraries_of_graphs_and_terminals():
    """Their 30,000 objects would be visited by each full garbage collection of the program."""
    code = (
        "import sys\nfrom dsc import parse_plot\nfrom planning import PlanningDomain, Robot\n"
        "domain = PlanningDomain.parse('(define (domain d) (:predicates (p)) (:action a :parameters () :effect (p)))')\n"
        "plot = parse_plot('{plot: a, implements: a, states: {s: {always: {to: e, tell: (p)}}, e: {final: true}}}')\n"
        "with Robot(domain, [plot], [], clock='simulated') as robot: assert robot.achieve('(p)')\n"
        "print([name for name in ('networkx', 'rich') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("package", ["dsc", "dsc.testing", "planning", "knowledge_base", "domains.clean_up_table"])
def test_every_public_name_can_be_imported(package):
    code = f"import {package} as p\nfor name in p.__all__: getattr(p, name)"
    subprocess.run([sys.executable, "-c", code], timeout=60, check=True)
