"""Python for the components of a robot: generated base classes, and the person's first subclasses of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from dsc.annotations import lower_name, type_class
from dsc.components.component import Component
from dsc.model.plot import ActionPlot
from dsc.skeletons.interfaces import ComponentUse, Known, SkillUse, Types, find_components
from dsc.skeletons.port_code import declarations, literal, parameters_class, simulate_values
from dsc.skeletons.python_types import annotation, object_types, record_class, sample, with_types_above
from dsc.text.typed_plots import is_python_name, type_definition
from knowledge_base.errors import InputError
from knowledge_base.world.schema import Schema

MARK = "Made by `dsc new --from`"
"""The beginning of each generated file; the command writes only these files again."""
_TYPING = ("Annotated", "Any", "Literal", "NewType")
_TAKEN = frozenset((*_TYPING, "ABC", "Component", "Outcome", "Parameters", "Push", "Simulation", "SkillCall", "Stream"))
_SIGNATURE = frozenset({"self", "call"})
_WIDTH = 100
_FROM_DSC = ("Component", "Outcome", "Parameters", "Push", "SkillCall", "Stream", "skill", "takes")


@dataclass(frozen=True)
class Skeleton:
    """The components that plots use, as Python.

    Attributes:
        components: the components by name.
        records: the records that the plots declare: the types of their fields by name.
        schema: the types of the domain; `None` without a domain.
    """

    components: Mapping[str, ComponentUse]
    records: Mapping[str, Mapping[str, str]]
    schema: Schema | None = None

    @classmethod
    def of(
        cls, plots: Iterable[ActionPlot], schema: Schema | None = None, known: Known = MappingProxyType({})
    ) -> Skeleton:
        """Return the skeleton of the components that plots use, except those of known skills, which each run has.

        Raises:
            InputError: a component, skill, port or parameter has a name that Python code cannot have.
        """
        plots, ready = list(plots), {name.partition(".")[0] for name in known}
        used = {name: one for name, one in find_components(plots, known).items() if name not in ready}
        for component, use in used.items():
            _require_names(component, *use.parameters)
            for port, values in {**use.ports.pushes, **dict.fromkeys(use.ports.streams, ())}.items():
                _require_new(component, port, values)
                if port in {*use.skills, *use.messages}:
                    raise InputError(f"'{component}.{port}' is a port and a skill or message; rename one", found=port)
            for name, parameters in _callables(use):
                _require_new(component, name, parameters)
                if used_up := _SIGNATURE.intersection(parameters):
                    message = f"'{component}.{name}' cannot have the parameter '{min(used_up)}', as its method has it"
                    raise InputError(message, found=min(used_up))
        records = {name: dict(fields) for plot in plots for name, fields in plot.types.items()}
        return cls(used, records, schema)

    @property
    def outcomes(self) -> dict[str, Types]:
        """The outcomes of all skills with the types of their attributes; different types of one attribute are open."""
        found: dict[str, Types] = {}
        for component in self.components.values():
            for skill in component.skills.values():
                for event, types in skill.outcomes.items():
                    known = found.setdefault(event, {})
                    for name, kind in types.items():
                        known[name] = kind if known.get(name, kind) in {kind, None} else None
        return found

    @property
    def objects(self) -> list[str]:
        """The types of objects that the components meet, each after its supertypes."""
        texts = [kind for use in self.components.values() for _, given in _callables(use) for kind in given.values()]
        texts += [kind for types in self.outcomes.values() for kind in types.values()]
        texts += [kind for fields in self.records.values() for kind in fields.values()]
        return with_types_above(object_types(texts, self.records), self.schema)

    def base_module(self) -> str:
        """Return the generated module: the types, the outcomes, and an abstract class for each component."""
        parts = ["\n".join(type_definition(one, self.schema) for one in self.objects)]
        parts += [record_class(name, fields) for name, fields in self.records.items()]
        parts += [self._outcome(event, types) for event, types in self.outcomes.items()]
        parts += [parameters_class(name, use) for name, use in self.components.items()]
        parts += [self._base(name, use) for name, use in self.components.items()]
        body = "\n\n\n".join(part for part in parts if part)
        from_dsc = _words(_FROM_DSC, body)
        imports = ["from abc import ABC, abstractmethod"] if self.components else []
        imports += ["from dataclasses import dataclass"] if self.records else []
        if used := _words(_TYPING, body):
            imports.append(f"from typing import {', '.join(used)}")
        imports += ["", f"from dsc import {', '.join(from_dsc)}"] if from_dsc else []
        head = f'"""{MARK}: the components as the plots use them. Do not edit this file."""'
        return "\n".join([head, "", "from __future__ import annotations", "", *imports, "", "", body, ""])

    def own_module(self, component: str, package: str) -> str:
        """Return the first text of the person's module of a component, with simulated skills."""
        use = self.components[component]
        methods = [self._simulate(name, skill) for name, skill in use.skills.items()]
        methods += [_method("takes", name, given, "None", body=["pass"]) for name, given in use.messages.items()]
        name, base = type_class(component), _base_class(component)
        begin = [f"class {name}({base}):", f'    """The component `{component}`."""', ""]
        begin += [
            "    def __init__(self, world: Simulation) -> None:",
            "        super().__init__()",
            "        self.world = world",
        ]
        simulated = simulate_values(use.ports)
        if simulated:
            begin[3:3] = [simulated[0], ""]
            methods.insert(0, "\n".join(simulated[2:]))
        body = "\n\n".join(["\n".join(begin), *methods])
        known = [*self.objects_and_records(), *(self.outcome_class(event) for event in self.outcomes), base]
        names = sorted(_words(known, body))
        from_dsc = _words(("Outcome", "SkillCall", "skill", "takes"), body)
        lines = [
            f'"""The component `{component}`; this file is yours, and `dsc new --from` never opens it again."""',
            "",
        ]
        lines += ["from __future__ import annotations", ""]
        lines += [f"from typing import {', '.join(used)}", ""] if (used := _words(_TYPING, body)) else []
        lines += [f"from dsc import {', '.join(from_dsc)}"] if from_dsc else []
        lines += ["from planning import Simulation", "", f"from {package}.generated.components import ("]
        lines += [*(f"    {one}," for one in names), ")", "", "", body, ""]
        return "\n".join(lines)

    def objects_and_records(self) -> list[str]:
        """Return the names of the classes of objects and records."""
        return [type_class(one) for one in (*self.objects, *self.records)]

    def outcome_class(self, event: str) -> str:
        """Return the name of the class of an outcome; a class of objects or of Python's own keeps its name."""
        name = type_class("-".join(re.split(r"[\W_]+", event)))
        taken = {
            *self.objects_and_records(),
            *_TAKEN,
            *(make(one) for one in self.components for make in (type_class, _base_class)),
        }
        return f"{name}Outcome" if name in taken or not is_python_name(name) else name

    def _result(self, skill: SkillUse) -> str:
        return " | ".join(map(self.outcome_class, skill.outcomes)) or "Outcome"

    def _outcome(self, event: str, types: Types) -> str:
        name = self.outcome_class(event)
        head = f"class {name}(Outcome):" if lower_name(name) == event else f'class {name}(Outcome, event="{event}"):'
        lines = [f"    {one}: {annotation(kind)}" for one, kind in types.items()]
        about = [f'    """The outcome `{event}`."""', *([""] if lines else [])]
        return "\n".join([head, *about, *lines])

    def _base(self, name: str, use: ComponentUse) -> str:
        lines = [
            f"class {_base_class(name)}(Component, ABC):",
            f'    """What plots use of the component `{name}`."""',
            "",
        ]
        lines += [f'    name = "{name}"', *declarations(name, use, self.components)]
        methods = [
            _method("skill", one, skill.parameters, self._result(skill), abstract=True)
            for one, skill in use.skills.items()
        ]
        methods += [_method("takes", one, given, "None", abstract=True) for one, given in use.messages.items()]
        return "\n\n".join(["\n".join(lines), *methods])

    def _simulate(self, name: str, skill: SkillUse) -> str:
        first, *others = [*skill.outcomes] or [_NO_OUTCOME]
        body = ["await call.clock.sleep(1.0)  # a real robot calls its driver here"]
        if others:
            kinds = ", ".join(f'"{event}"' for event in others)
            body.append(f"match self.world.fault(call.action_id, {kinds}):")
            for event in others:
                body += [f'    case "{event}":', f"        return {self._make(event, skill)}"]
        body.append(f"return {self._make(first, skill)}")
        return _method("skill", name, skill.parameters, self._result(skill), body=body)

    def _make(self, event: str, skill: SkillUse) -> str:
        """Return the expression of an outcome: an attribute fits a guard, repeats a parameter, or has a sample."""
        if event == _NO_OUTCOME:
            return f'Outcome("{event}")'
        by_type = {kind: name for name, kind in reversed(skill.parameters.items())}
        by_type.pop(None, None)
        fitting = {name: literal(value) for name, value in skill.values.get(event, {}).items()}
        values = (
            f"{name}={fitting.get(name) or by_type.get(kind) or sample(kind, self.schema)}"
            for name, kind in self.outcomes[event].items()
        )
        return f"{self.outcome_class(event)}({', '.join(values)})"


_NO_OUTCOME = "ended"


def module_name(component: str) -> str:
    """Return the name of a component's module."""
    return component.replace("-", "_")


def _base_class(component: str) -> str:
    return f"{type_class(component)}Skills"


def _require_new(component: str, name: str, inside: Iterable[str]) -> None:
    """Raise `InputError` unless a skill, message or port, and the names inside, can be names in a class."""
    _require_names(f"{component}.{name}", module_name(component), name, *inside)
    if hasattr(Component, name):
        raise InputError(f"'{name}' of '{component}' is an attribute of every component; rename it", found=name)


def _require_names(who: str, *names: str) -> None:
    for one in names:
        if not is_python_name(one):
            raise InputError(f"'{who}' becomes Python code, in which '{one}' is not a name; rename it", found=one)


def _callables(use: ComponentUse) -> Iterator[tuple[str, Types]]:
    yield from ((name, skill.parameters) for name, skill in use.skills.items())
    yield from use.messages.items()


def _method(
    decorator: str, name: str, given: Types, returned: str, *,
    abstract: bool = False, body: Iterable[str] = ("...",),
) -> str:  # fmt: skip
    taken = ["self", *(["call: SkillCall"] if decorator == "skill" else [])]
    taken += [f"{one}: {annotation(kind)}" for one, kind in given.items()]
    head = f"    async def {name}({', '.join(taken)}) -> {returned}:"
    if len(head) > _WIDTH:
        head = "\n".join([f"    async def {name}(", f"        {', '.join(taken)},", f"    ) -> {returned}:"])
    marks = [f"    @{decorator}", *(["    @abstractmethod"] if abstract else [])]
    return "\n".join([*marks, head, *(f"        {line}" for line in body)])


def _words(names: Iterable[str], text: str) -> list[str]:
    """Return the names that occur in a text as words."""
    return [name for name in dict.fromkeys(names) if re.search(rf"\b{name}\b", text)]
