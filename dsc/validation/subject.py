"""The subject of validation: a plot with its surroundings, walked once, and the findings about it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Literal

from dsc.components.parameters import Parameter
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
"""Names -> declared types; `None` is any type."""
Skills = Mapping[str, SkillSignature] | None
"""The deployed skills by `component.skill`; `None` if unknown."""
Components = Collection[str] | Mapping[str, Mapping[str, Parameter]]
"""The names of components, or their declared parameters as well; names alone allow any parameter."""
Way = tuple[Path, str, Transition]
"""A transition with its path and the label of its trigger."""


class Subject:
    """A plot, the names that it may use, and its states and transitions by name and by path.

    Attributes:
        plot: the plot.
        library: provider of the plots it uses.
        schema, skills, components: the declared types and the deployment; `None` if unknown.
        strict: whether the plot has the rules of dialect `dsc`, not of SCXML.
        states: all states in document order, with their names and paths.
        steps: those that hold another plot.
        names: the paths of all states by name, in document order.
        planned: whether a step has a goal.
        assigned, types: the declared types of variables and outputs; of parameters, too.
    """

    def __init__(
        self,
        plot: ActionPlot,
        library: Library,
        schema: Schema | None = None,
        skills: Skills = None,
        components: Components | None = None,
    ) -> None:
        self.plot, self.library = plot, library
        self.schema, self.skills, self.components = schema, skills, components
        self.strict = plot.dialect == "dsc"
        self.states = tuple(plot.walk())
        self.steps = tuple((name, state, path) for name, state, path in self.states if isinstance(state, Step))
        self.names = {name: path for name, _, path in self.states}
        self.planned = any(is_planned(state) for _, state, _ in self.steps)
        self.assigned = {name: one.type for name, one in (plot.variables | plot.outputs).items()}
        self.types: Types = {**{name: one.type for name, one in plot.parameters.items()}, **self.assigned}
        self._states = {path: state for _, state, path in self.states}
        self._leaving = {
            path: tuple(((*path, *inside), trigger, way) for inside, trigger, way in state.placed_transitions())
            for _, state, path in self.states
            if isinstance(state, TransitionSource)
        }

    def leaving(self, path: Path) -> tuple[Way, ...]:
        """Return the transitions of the state at `path`, in order."""
        return self._leaving.get(path, ())

    def ways(self) -> Iterator[Way]:
        """Yield all transitions."""
        for ways in self._leaving.values():
            yield from ways

    def way_to(self, path: Path) -> Iterator[Path]:
        """Yield the paths of the states around the one at `path`, outermost first, and its own."""
        return (path[:length] for length in range(1, len(path) + 1) if path[:length] in self._states)

    def around(self, path: Path) -> Iterator[State]:
        """Yield the composite and orthogonal states around the one at `path`, outermost first."""
        states = (self._states[place] for place in self.way_to(path[:-1]))
        return (state for state in states if isinstance(state, State))

    def state(self, name: str) -> AnyState:
        """Return the state of that name, which must exist."""
        return self._states[self.names[name]]

    def contents(self, name: str | None) -> list[ActionPlot]:
        """Return the plots that the state of that name may hold; nothing for `None` and for other kinds of states."""
        state = None if name is None else self.state(name)
        return contents_of(state, self.library) if isinstance(state, Step) else []

    def inside(self, name: str, path: Path) -> bool:
        """Return whether the state at `path` contains a state of that name; the whole plot if `path` is empty."""
        found = self.names.get(name, path)
        return found != path and found[: len(path)] == path

    def within(self, path: Path) -> set[str]:
        """Return the names of all states for which `inside` holds; slow, for messages only."""
        return {name for name in self.names if self.inside(name, path)}

    def reactions(self) -> Iterator[tuple[Path, Reaction]]:
        """Yield the reactions of all rules and handlers, with their paths."""
        for number, rule in enumerate(self.plot.rules):
            yield ("rules", number, "do"), rule.do
        for number, handler in enumerate(self.plot.handlers):
            yield ("handlers", number, "do"), handler.do

    def actions(self) -> Iterator[tuple[Path, ExternalAction | Internal, Who]]:
        """Yield the actions of states and the commands of rules and handlers: path, action, and the acting role."""
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
        """Return a finding at the place of the part at `path`; with `valid` names it is about an unknown name."""
        place = self.plot.place(path)
        if valid is None:
            return Finding(SchemaError(message, place=place, found=found), rule, fix, level)
        return Finding(UnknownNameError(message, place=place, found=found, valid=valid), rule, fix, level)

    def caught(self, error: InputError, path: Path, rule: str, fix: str = "") -> Finding:
        """Return an error as a finding at `path`; the error's own place is relative to the text there."""
        error.place = self.plot.place(path) or error.place
        return Finding(error, rule, fix)

    def unknown_plot(self, path: Path, name: str) -> Finding:
        """Return the finding about a missing plot."""
        valid = {other.name for other in self.library}
        return self.finding(path, "known plot", f"there is no plot '{name}'", found=name, valid=valid)


def addressed_by(plot: ActionPlot) -> frozenset[str]:
    """Return the components that a plot itself uses; a plot that uses none is abstract, else primitive (S0.9)."""
    named = (component_of(one) for one in flat(action for _, action, _ in Subject(plot, Library()).actions()))
    return frozenset(name for name in named if name is not None)
