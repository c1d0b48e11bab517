"""Facts of a robot project that only its Python code knows: skills, parameters of components, plots and objects.

Another process executes the project's code and returns the facts as JSON. So the server runs no user code, and each
answer has the facts of the present code.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from dsc.skills import SkillSignature
from knowledge_base.exchange import schema_of
from knowledge_base.world.schema import Schema


@dataclass(frozen=True, slots=True)
class ComponentFacts:
    """The names of a component that charts and profiles use.

    Attributes:
        parameters: a line of text about each parameter, by name.
        modes: the modes.
        messages: the messages that the component takes.
    """

    parameters: Mapping[str, str] = field(default_factory=dict)
    modes: Collection[str] = ()
    messages: Collection[str] = ()


@dataclass(frozen=True, slots=True)
class ProjectFacts:
    """The facts of one project; empty if its robot cannot be made.

    Attributes:
        skills: the skills of the deployed components; `None` if they are unknown.
        about: the docstrings of the skills, by `component.skill`.
        components: facts of the components by name.
        plots: the file of each plot of the robot by the plot's name; empty for a plot that Python code makes.
        objects: types of the objects with which a run begins, by name; `None` if they are unknown.
        schema: the merged declarations of all domains of the robot; `None` if they are unknown.
        scenario: the JSON Schema of the simulation's scenarios; `None` if it declares none.
    """

    skills: tuple[SkillSignature, ...] | None = None
    about: Mapping[str, str] = field(default_factory=dict)
    components: Mapping[str, ComponentFacts] = field(default_factory=dict)
    plots: Mapping[str, str] = field(default_factory=dict)
    objects: Mapping[str, str] | None = None
    schema: Schema | None = None
    scenario: Mapping[str, Any] | None = None

    @classmethod
    def read(cls, form: Mapping[str, Any]) -> ProjectFacts:
        """Return the facts in JSON data, as `planning.cli.examination` writes them."""
        skills, schema = form.get("skills"), form.get("schema")
        return cls(
            skills=None if skills is None else tuple(SkillSignature(**one) for one in skills),
            about=form.get("about", {}),
            components={name: ComponentFacts(**one) for name, one in form.get("components", {}).items()},
            plots=form.get("plots", {}),
            objects=form.get("objects"),
            schema=None if schema is None else schema_of(schema),
            scenario=form.get("scenario"),
        )

    def skill(self, name: str) -> SkillSignature | None:
        """Return the skill `component.skill`; `None` if it is unknown."""
        return next((one for one in self.skills or () if f"{one.component}.{one.name}" == name), None)
