"""Blocks of actions of a controller, made of the actions of states and transitions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from dsc.controllers.expressions import RefusedError, Typing
from dsc.controllers.model import (
    Action,
    Activity,
    Arguments,
    Assign,
    Block,
    Branch,
    Command,
    Comparison,
    Controller,
    Fire,
    Fixed,
    Group,
    Read,
    Start,
    Timer,
    Value,
)
from dsc.controllers.names import AnyAction, arguments_of, convert
from dsc.controllers.refusals import REFUSED_ACTIONS, Refusals
from dsc.data_types import data_type
from dsc.engine.tables import CompiledPlot
from dsc.model import actions as model
from dsc.model.language import TermField
from dsc.model.reading import FormPath
from knowledge_base.language.syntax.expression import Constant


class BlockBuilder:
    """Builder of the blocks of one plot."""

    def __init__(self, controller: Controller, compiled: CompiledPlot, typing: Typing, refusals: Refusals) -> None:
        self._controller, self._compiled = controller, compiled
        self._typing, self._refusals = typing, refusals
        self._numbers: dict[tuple[int, str], int] = {}

    def add(self, about: str, actions: Iterable[AnyAction], path: FormPath, node: int) -> int:
        """Add a block of actions of a node, and return its number; 0 for a block without actions."""
        made = self._make_all(about, actions, path, node)
        if not made:
            return 0
        self._controller.blocks.append(Block(about, tuple(made)))
        return len(self._controller.blocks) - 1

    def _make_all(self, about: str, actions: Iterable[AnyAction], path: FormPath, node: int) -> list[Action]:
        made: list[Action] = []
        for action in actions:
            if type(action) in REFUSED_ACTIONS:
                continue
            with self._refusals.at(path):
                made.append(self._action(about, action, path, node))
        return made

    def _action(  # noqa: PLR0911  # a table by kind
        self, about: str, action: AnyAction, path: FormPath, node: int
    ) -> Action:
        match action:
            case model.Assign(assign=terms):
                return self._assignment(terms)
            case model.Perform():
                return self._assignment(self._compiled.plot.motor_values(action))
            case model.StartActivity() | model.StopActivity():
                name, active = action.change
                changes = Comparison("eq", Read("data", name, "boolean"), Fixed(not active, "boolean"))
                return Branch(changes, (self._assignment(self._compiled.plot.motor_values(action)),), ())
            case model.Emit():
                return self._fire(action)
            case model.Trigger():
                return Start(self._activity(action, node), self._arguments(action))
            case model.Choose(condition=condition, then=then, otherwise=otherwise):
                branches = [tuple(self._make_all(about, some, path, node)) for some in (then, otherwise)]
                return Branch(self._typing.condition(condition), *branches)
            case model.Block(block=inside):
                return Group(self.add(f"block of {about}", inside, path, node))
            case model.Configure() | model.Switch() | model.Send():
                return self._command(action)
            case _:
                raise AssertionError(action)

    def _assignment(self, terms: Mapping[str, TermField]) -> Assign:
        return Assign(tuple([(name, self._assign(name, term)) for name, term in terms.items()]))

    def _assign(self, name: str, term: TermField) -> Value:
        plot = self._compiled.plot
        declared = {**plot.parameters, **plot.all_variables, **plot.outputs}
        if name not in declared:
            raise RefusedError(f"there is no variable '{name}'", found=name, valid=[*declared])
        return self._typing.of_type(self._typing.value(term), data_type(declared[name].type), term.place)

    def _fire(self, action: model.Emit) -> Fire:
        plot = self._compiled.plot
        types = plot.emits.get(action.emit) or {}
        values = []
        for name, term in action.arguments.items():
            value = self._typing.value(term)
            if name in types:
                value = self._typing.of_type(value, data_type(types[name]), term.place)
            values.append((name, self._typing.convert(value, self._controller.attributes[name])))
        return Fire(self._controller.events.index(action.emit), tuple(values), action.emit in plot.emits)

    def _arguments(self, action: AnyAction) -> Arguments:
        return convert(arguments_of(action), self._controller.arguments, self._typing)

    def _activity(self, action: model.Trigger, node: int) -> int:
        controller, number, timer = self._controller, len(self._controller.activities), -1
        if action.within is not None:
            timer = len(controller.timers)
            controller.timers.append(Timer("within", node, number, Fixed(float(action.within), "number")))
        controller.activities.append(Activity(action.trigger, node, timer))
        return number

    def _command(self, action: model.Configure | model.Switch | model.Send) -> Command:
        match action:
            case model.Switch(switch=component, to=mode):
                return Command(self._number(f"switch {component} {mode}"), ())
            case model.Configure(set=parameter, to=Constant(value=str(word))):
                return Command(self._number(f"set {parameter} {word}"), ())
            case model.Configure(set=parameter):
                return Command(self._number(f"set {parameter}"), self._arguments(action))
            case model.Send(send=port):
                return Command(self._number(f"send {port}"), self._arguments(action))

    def _number(self, text: str) -> int:
        commands, text = self._controller.commands, re.sub(r"\s+", " ", text)
        if text not in commands:
            commands.append(text)
        return commands.index(text)
