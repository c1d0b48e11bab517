"""The process that examines a project for an editor: `python -m planning.cli.examination TARGET`.

Standard input has the editor's unsaved texts as a JSON object by file. Standard output receives one JSON object:
`findings`, as `dsc check --json` prints them with their full text, and `facts`, see `dsc.editing.project_facts`. A new
process for each examination executes the present Python code of the project.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dsc.components.component import Component
from dsc.editing.diagnostics import FileFinding
from dsc.model.plot import ActionPlot
from dsc.skills import SkillSignature
from dsc.text.plot_files import file_of
from knowledge_base.errors import DscError, collecting, tolerated
from knowledge_base.exchange import schema_form
from knowledge_base.language.checking.vocabulary import ROOT_TYPE
from knowledge_base.store import KnowledgeBase
from planning.cli.editor_process import answer_editor
from planning.robot.bringup import begin, simulated
from planning.robot.bundles import Bundle, components_of, gathered
from planning.robot.checking import check_project
from planning.robot.project_files import objects_in
from planning.robot.simulation import Setup, Simulation, components_in
from planning.robot.soundness import run_skills
from planning.robot.targets import bundle_at


def examination(target: str) -> dict[str, Any]:
    """Return the findings about a target, and the facts of its robot; without a robot, the facts are empty."""
    findings = [asdict(FileFinding.of(one, Path(target))) for one in check_project(target)]
    facts: dict[str, Any] = {}
    with collecting(), tolerated():
        try:
            facts = facts_of(bundle_at(target), target)
        except DscError:  # a finding reports it
            facts = {}
    return {"findings": findings, "facts": facts}


def facts_of(bundle: Bundle, target: str) -> dict[str, Any]:
    """Return the facts of a robot and its target as JSON data; errors as for its components, simulation and domains."""
    simulation = simulated(bundle, Setup())
    bundles = gathered([bundle])
    own = () if simulation is None else components_in(simulation)
    components = [*components_of(bundles), *own]
    schema = bundle.planning_domain.schema
    skills = [*(skill for one in components for skill in one.skills().values()), *run_skills()]
    form = None if simulation is None else simulation.scenario_form
    return {
        "skills": None if bundle.remote else [asdict(one) for one in _plain(skills)],
        "about": _docstrings(components),
        "components": {one.name: _component_facts(one) for one in components},
        "plots": {plot.name: _path_of(plot) for one in bundles for plot in one.plots},
        "objects": _objects(bundle, simulation, target),
        "schema": schema_form(schema),
        "scenario": None if form is None else form.model_json_schema(by_alias=True),
    }


def _plain(skills: Iterable[SkillSignature]) -> Iterable[SkillSignature]:
    """Yield the signatures with values that JSON has."""
    for one in skills:
        defaults = {name: value if _is_plain(value) else str(value) for name, value in one.defaults.items()}
        yield SkillSignature(**{**_fields(one), "defaults": defaults})


def _fields(one: SkillSignature) -> dict[str, Any]:
    return {name: getattr(one, name) for name in SkillSignature.__slots__}


def _is_plain(value: object) -> bool:
    return value is None or isinstance(value, str | int | float | bool)


def _docstrings(components: Sequence[Component]) -> dict[str, str]:
    """Return the docstrings of the skills, by `component.skill`."""
    texts = {f"{one.name}.{name}": getattr(type(one), name, None) for one in components for name in one.skills()}
    return {name: text for name, body in texts.items() if (text := getattr(body, "__doc__", None))}


def _component_facts(component: Component) -> dict[str, Any]:
    known = component.interface()
    return {
        "parameters": {name: _describe(one) for name, one in known.parameters.items()},
        "modes": list(known.modes),
        "messages": list(known.messages or ()),
    }


def _describe(parameter: Any) -> str:
    said = [f"{parameter.type}"]
    said += [f"from {parameter.least:g}"] if parameter.least is not None else []
    said += [f"to {parameter.most:g}"] if parameter.most is not None else []
    said += [f"one of {', '.join(map(str, parameter.among))}"] if parameter.among else []
    said += [f"default {parameter.default}"] if parameter.default is not None else []
    return ", ".join(said)


def _path_of(plot: ActionPlot) -> str:
    file = file_of(plot)
    return "" if file is None else str(file.absolute())


def _objects(bundle: Bundle, simulation: Simulation | None, target: str) -> dict[str, str] | None:
    """Return the types of the objects with which a run begins; `None` if the knowledge has a mistake."""
    with collecting(), tolerated():
        world = KnowledgeBase(bundle.planning_domain.schema)
        begin(world, bundle, simulation, "check")
        kinds = {name: world.type_of(name) for name in world.objects(ROOT_TYPE)}
        near = {name: kind for file in _problems(target) for name, kind in objects_in(file, world.schema).items()}
        return near | {name: kind for name, kind in kinds.items() if kind is not None}
    return None


def _problems(target: str) -> Iterable[Path]:
    """Yield the PDDL files of a target that is a folder."""
    folder = Path(target)
    return folder.rglob("*.pddl") if folder.is_dir() else ()


def main() -> None:
    """Examine the target of the command line, with the texts on standard input."""
    answer_editor(lambda: examination(sys.argv[1]))


if __name__ == "__main__":
    main()
