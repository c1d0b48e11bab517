"""The tutorial page: nine programs with their outputs. `python tests/tutorial.py` writes docs/tutorial.md anew."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "tutorial.md"
STEPS = sorted((ROOT / "examples" / "tutorial").glob("step*.py"))
MARK = "# Expected output:\n"
READ_ON = {
    1: "[Skills and components](skills.md)",
    2: "[Plots](plots.md)",
    3: "[Semantics of charts](semantics.md) and [the condition language](language.md)",
    4: "[PDDL files](pddl.md) and [planning engines](engines.md)",
    5: "[rules](plots.md#rules)",
    6: "[event handlers](plots.md#event-handlers)",
    7: "[Tests](testing.md)",
    8: "[Running a robot](run.md) and [the viewer](viewer.md)",
    9: "[Data in plots](data.md)",
}
BEGINNING = """# Tutorial

A delivery robot in nine steps. Each step is a program in [examples/tutorial](../examples/tutorial) that ends with its
output; a later step imports the parts of earlier ones. After `make demo`, run a
step with `.venv/bin/python examples/tutorial/step1_skill.py`.

The steps have all parts in one Python file, so that you see them together. Afterwards, `dsc new my_robot` makes a
project with separate files for plots and domain, and a simulated house with faults; see [Running a
robot](run.md#start-a-project). Both forms make a `Bundle`, as in step 8.
"""
END = """
`dsc check examples/tutorial/step8_browser.py` finds mistakes without a run. `dsc run
examples/tutorial/step8_browser.py --view` shows the plan while it is executed, and the reason for each decision:

![A run in the browser: the running plot of a plan, and the reason for the new one](pictures/viewer_plan.png)
"""


def page() -> str:
    """Return the page for the present programs."""
    return BEGINNING + "".join(_section(number, file) for number, file in enumerate(STEPS, start=1)) + END


def _section(number: int, file: Path) -> str:
    source = file.read_text("utf-8")
    program, _, output = source.partition(MARK)
    about = ast.get_docstring(ast.parse(source)) or ""
    title, _, text = about.partition(": ")
    code = program.partition('"""\n')[2].strip()
    shown = "\n".join(line.removeprefix("#").removeprefix(" ") for line in output.splitlines())
    name = file.relative_to(ROOT)
    return (
        f"\n## {title}\n\n{text[:1].upper()}{text[1:]}\n\n````python\n{code}\n````\n\n"
        f"```console\n$ python {name}\n{shown}\n```\n\nRead on: {READ_ON[number]}.\n"
    )


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
