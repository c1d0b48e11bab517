"""Subject of validation: a plot with its library and deployment, indexed for all checks."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Literal

from dsc.components.interface import Interface
from dsc.dynamic.library import Library
from dsc.dynamic.steps import Step, contents_of, is_planned
from dsc.errors import Finding
from dsc.model.actions import ExternalAction, Internal, component_of, flat
from dsc.model.plot import ActionPlot, Path
from dsc.model.ranges import Who
from dsc.model.rules import Reaction
from dsc.model.states import AnyState, State
from dsc.model.transitions import Transition, TransitionSource
from dsc.skills import SkillSignature
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.world.schema import Schema

Types = Mapping[str, str | None]
"""Declared types by name; `None` means any type."""
Skills = Mapping[str, SkillSignature] | None
"""The deployed skills by `component.skill`; `None` if the deployment is unknown."""
Components = Collection[str] | Mapping[str, Interface]
"""Names of components, or their interfaces by name; names alone allow any parameter, mode and message."""
ALLOW = "set it in a profile, or let `changed_by` allow it"
"""The remedy for a role that may not change a parameter."""
Way = tuple[Path, str, Transition]
"""Path, label of the trigger, and transition."""


def by_trigger(skills: Iterable[SkillSignature]) -> dict[str, SkillSignature]:
    """Return signatures of skills by the name that triggers use, `component.skill`."""
    return {f"{one.component}.{one.name}": one for one in skills}


class Subject:
    """A plot to check, the names to which it may refer, and its states and transitions by name and by path.

    Attributes:
        plot: the plot to check.
        library: provider of the plots to which the plot refers.
        schema, skills, components: declared types, deployed skills and components; `None` if unknown.
        objects: types of the objects with which a run begins, by name; `None` if unknown.
        strict: whether the plot is in dialect `dsc`; dialect `scxml` has fewer rules.
        states: name, state and path of all states, in document order.
        steps: name, state and path of the states that contain another plot.
        names: paths of all states by name, in document order.
        planned: whether a dynamic state has a goal.
        assigned: declared types of variables, outputs and motors, by name.
        types: declared types of all readable names.
        interfaces: interfaces of the components by name; empty if unknown.
        records: the records of the library, of the skills and of messages.
    """

    def __init__(
        self,
        plot: ActionPlot,
        library: Library,
        schema: Schema | None = None,
        skills: Skills = None,
        components: Components | None = None,
        objects: Mapping[str, str] | None = None,
    ) -> None:
        self.plot, self.library = plot, library
        self.schema, self.skills, self.components, self.objects = schema, skills, components, objects
        self.strict = plot.dialect == "dsc"
        self.states = tuple(plot.walk())
        self.steps = tuple((name, state, path) for name, state, path in self.states if isinstance(state, Step))
        self.names = {name: path for name, _, path in self.states}
        self.planned = any(is_planned(state) for _, state, _ in self.steps)
        motors = {} if plot.robot is None else plot.robot.motors
        self.assigned = {name: one.type for name, one in (plot.variables | plot.outputs | motors).items()}
        readable = {**plot.parameters, **plot.all_variables}
        self.types: Types = {**{name: one.type for name, one in readable.items()}, **self.assigned}
        self.records: dict[str, Mapping[str, str | None]] = dict(library.records)
        self.interfaces: Mapping[str, Interface] = components if isinstance(components, Mapping) else {}
        messages = [one for interface in self.interfaces.values() for one in (interface.messages or {}).values()]
        for declared in (*(skills or {}).values(), *messages):
            self.records.update(declared.records)
        self._states = {path: state for _, state, path in self.states}
        self._leaving = {
            path: tuple(((*path, *inside), trigger, way) for inside, trigger, way in state.placed_transitions())
            for _, state, path in self.states
            if isinstance(state, TransitionSource)
        }

    def leaving(self, path: Path) -> tuple[Way, ...]:
        """Return the outgoing transitions of the state at `path`, in order."""
        return self._leaving.get(path, ())

    def ways(self) -> Iterator[Way]:
        """Yield all transitions of the plot."""
        for ways in self._leaving.values():
            yield from ways

    def way_to(self, path: Path) -> Iterator[Path]:
        """Yield the paths of the states that contain the state at `path`, outermost first, then `path`."""
        return (path[:length] for length in range(1, len(path) + 1) if path[:length] in self._states)

    def around(self, path: Path) -> Iterator[State]:
        """Yield the composite and orthogonal states that contain the state at `path`, outermost first."""
        states = (self._states[place] for place in self.way_to(path[:-1]))
        return (state for state in states if isinstance(state, State))

    def state(self, name: str) -> AnyState:
        """Return the state of that name; raise `KeyError` if there is none."""
        return self._states[self.names[name]]

    def contents(self, name: str | None) -> list[ActionPlot]:
        """Return the plots that may become the content of the step `name`; empty for any other state or `None`."""
        state = None if name is None else self.state(name)
        return contents_of(state, self.library) if isinstance(state, Step) else []

    def inside(self, name: str, path: Path) -> bool:
        """Return whether the state at `path` contains a state of that name; an empty `path` is the whole plot."""
        found = self.names.get(name, path)
        return found != path and found[: len(path)] == path

    def within(self, path: Path) -> set[str]:
        """Return the names of all states inside the state at `path`; slow, for messages only."""
        return {name for name in self.names if self.inside(name, path)}

    def reactions(self) -> Iterator[tuple[Path, Reaction]]:
        """Yield path and reaction of each rule and handler."""
        for number, rule in enumerate(self.plot.rules):
            yield ("rules", number, "do"), rule.do
        for number, handler in enumerate(self.plot.handlers):
            yield ("handlers", number, "do"), handler.do

    def actions(self) -> Iterator[tuple[Path, ExternalAction | Internal, Who]]:
        """Yield path, action and acting role of all actions of states and all commands of rules and handlers."""
        for _, state, path in self.states:
            for key, actions in state.blocks() if isinstance(state, State) else ():
                yield from (((*path, key, position), action, "plots") for position, action in enumerate(actions))
        for path, do in self.reactions():
            yield from (((*path, "command", position), one, "rules") for position, one in enumerate(do.command))

    def finding(
        self,
        path: Path,
        rule: str,
        message: str,
        fix: str = "",
        *,
        found: str | None = None,
        valid: Iterable[str] | None = None,
        level: Literal["error", "warning"] = "error",
    ) -> Finding:
        """Return a finding about the part at `path`; with `valid` names, the finding reports an unknown name."""
        place = self.plot.place(path)
        if valid is None:
            return Finding(SchemaError(message, place=place, found=found), rule, fix, level)
        return Finding(UnknownNameError(message, place=place, found=found, valid=valid), rule, fix, level)

    def caught(self, error: InputError, path: Path, rule: str, fix: str = "") -> Finding:
        """Return an error as a finding about the part at `path`; the error's place is relative to this part's text."""
        error.place = self.plot.place(path) or error.place
        return Finding(error, rule, fix)

    def unknown_plot(self, path: Path, name: str) -> Finding:
        """Return the finding about a reference to a missing plot."""
        valid = {other.name for other in self.library}
        owner, dot, _ = name.partition(".")
        fix = f"the component '{owner}' brings it, and is not deployed here" if dot else ""
        return self.finding(path, "known-plot", f"there is no plot '{name}'", fix, found=name, valid=valid)


def addressed_by(plot: ActionPlot) -> frozenset[str]:
    """Return the names of the components that a plot itself uses; empty for an abstract plot (S0.9)."""
    named = (component_of(one) for one in flat(action for _, action, _ in Subject(plot, Library()).actions()))
    return frozenset(name for name in named if name is not None)
