"""The parts of a robot that another robot may use: its domain, its planning actions, and its knowledge (S2.7)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from dsc.components.declarations import Parameter, Type
from dsc.dynamic.library import Library
from dsc.events import NO_CANDIDATE
from dsc.model.plot import ActionPlot
from dsc.model.ranges import may_change
from dsc.run_log import run_logger
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.language.checking.vocabulary import ROOT_TYPE
from knowledge_base.language.syntax.expression import Constant
from planning.execution.shipped_plots import shipped_plots
from planning.model.actions import PlanningAction
from planning.model.domain import PlanningDomain
from planning.model.plan import PlanStep
from planning.robot.robot import Robot

_LOG = run_logger(__package__)
_TYPES: Mapping[str, Type] = {"number": "number", "boolean": "boolean"}


def shared_domain(name: str, domain: PlanningDomain) -> str | None:
    """Return the domain of the robot of that name as PDDL; `None`, with a warning, if PDDL cannot express it."""
    try:
        return domain.to_pddl()
    except InputError as error:
        _LOG.warning("the robot '%s' keeps its domain to itself: %s", name, error)
        return None


def own_plots(library: Library) -> list[ActionPlot]:
    """Return the plots of a library without those that each robot has, and without plans."""
    shipped = {plot.name for plot in shipped_plots()}
    return [plot for plot in library if plot.name not in shipped and not plot.generated]


def defaults_of(plots: Iterable[ActionPlot]) -> dict[str, Parameter]:
    """Return the defaults of plots that an operator may change, as parameters `PLOT.PARAMETER` (S1.22)."""
    found = {}
    for plot in plots:
        for name, one in plot.parameters.items():
            default = one.default.value if isinstance(one.default, Constant) else None
            if isinstance(default, str | int | float) and may_change("operator", one.changed_by):
                found[f"{plot.name}.{name}"] = Parameter(
                    _TYPES.get(one.range.type, "text"), one.range.whole, default, one.least, one.most, one.among
                )
    return found


NOTHING_FITS = "nothing_fits"
"""The outcome of a plot for an action if the condition of no candidate is true."""


def plots_of_actions(robot: Robot) -> dict[str, str]:
    """Return the actions by the plots that execute them; add a plot for each action that has several candidates.

    Such a plot chooses among the candidates on its entry. Its name is `ACTION` or `ACTION-choice`.
    """
    found = {}
    for action in robot.domain.actions.values():
        candidates = robot.library.implementing(action.name)
        whole = all({one.name for one in action.parameters} <= plot.parameters.keys() for plot in candidates)
        if len(candidates) == 1 and whole and candidates[0].when is None:
            found[candidates[0].name] = action.name
        elif candidates:
            name = action.name if action.name not in robot.library else f"{action.name}-choice"
            robot.library.add(_choice(name, action, candidates))
            found[name] = action.name
    return found


def _choice(name: str, action: PlanningAction, candidates: Sequence[ActionPlot]) -> ActionPlot:
    """Return the plot that executes a planning action by one of its candidates."""
    emits = {event: attributes for plot in candidates for event, attributes in plot.emits.items()}
    ways: dict[str, Any] = {"done": "over", NO_CANDIDATE: {"to": "ended", "emit": NOTHING_FITS}}
    for event, attributes in emits.items():
        ways[event] = {"to": "ended", "emit": event, "with": {name: f"?event.{name}" for name in attributes or ()}}
    taken = {name: one.type for plot in candidates for name, one in plot.parameters.items()}
    names = [one.name for one in action.parameters]
    given = {name: f"?{name}" for name in names if name in taken}
    used = {"dynamic": [plot.name for plot in candidates], "with": given, "on": ways}
    parameters = {one.name: taken.get(one.name) or (one.types or (ROOT_TYPE,))[0] for one in action.parameters}
    return ActionPlot.model_validate({
        "plot": name, "parameters": parameters, "emits": {**emits, NOTHING_FITS: None},
        "states": {"choose": used, "over": {"final": True}, "ended": {"final": True}},
    })  # fmt: skip


def confirmed_effects(action: str, arguments: Mapping[str, Any], robot: Robot) -> Delta:
    """Return the effects of an executed action that the robot's knowledge confirms.

    Another robot may have missed them, e.g. if the robot knew them before this execution.
    """
    knowledge, parameters = robot.knowledge, robot.domain.actions[action].parameters
    step = PlanStep(action, tuple([str(arguments[one.name]) for one in parameters]))
    try:
        effects = robot.domain.effects(step, knowledge)
    except InputError:  # e.g. the robot does not know a number that the action increases
        return Delta()
    values = knowledge.values() if effects.values else {}
    true = Delta(
        added=tuple([one for one in effects.added if knowledge.holds(one.predicate, one.args)]),
        removed=tuple([one for one in effects.removed if not knowledge.holds(one.predicate, one.args)]),
        values={one: values[one] for one in effects.values if one in values},
    )
    return shared_part(true, robot)


def shared_knowledge(robot: Robot) -> Delta:
    """Return all objects, facts and values that the robot's domain declares."""
    known = robot.knowledge.snapshot()
    return shared_part(Delta(known.nodes, added=tuple(known.facts), values=known.values), robot)


def shared_part(change: Delta, robot: Robot) -> Delta:
    """Return the part of a change that the robot's domain declares, with the types of all objects in it."""
    schema, type_of = robot.domain.schema, robot.knowledge.type_of
    added, removed = (
        [one for one in facts if one.predicate in schema.predicates] for facts in (change.added, change.removed)
    )
    values = {one: value for one, value in change.values.items() if one.predicate in schema.functions}
    named = [name for one in (*added, *values) for name in one.args if isinstance(name, str)]
    nodes = {name: type_ for name in named if (type_ := type_of(name)) is not None}
    nodes = {name: type_ for name, type_ in {**change.nodes, **nodes}.items() if type_ in schema.types}
    return Delta(nodes, tuple(removed), tuple(added), values, change.removed_nodes)
