"""Components whose skills answer what the test has laid down, and remember how they were called."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from dsc.skills import Component, Outcome, SkillCall, SkillSignature, check_arguments
from dsc.testing.worlds import change_of
from knowledge_base.errors import InputError, ParseError, UnknownNameError
from knowledge_base.facts import Delta
from knowledge_base.store import KnowledgeBase


@dataclass(frozen=True, slots=True)
class Answer:
    """How a scripted skill ends.

    Attributes:
        event: its outcome event.
        attributes: the event's attributes.
        after: seconds of run time it takes; `math.inf`: it never ends by itself.
        observed: what is known with the outcome: a change, or a PDDL effect in which `?name` stands for an argument
            of the call, e.g. `(holding ?item)`.
        reports: what it reports on the way, each `after` the one before.
    """

    event: str
    attributes: Mapping[str, Any] = field(default_factory=dict)
    after: float = 1.0
    observed: Delta | str = field(default_factory=Delta)
    reports: tuple[Answer, ...] = ()


@dataclass(frozen=True, slots=True)
class Call:
    """One call of a scripted skill: `component.skill`, its arguments, and the second of run time at which it came."""

    skill: str
    arguments: Mapping[str, Any]
    at: float


Reply = str | Answer | Exception
"""An answer; an outcome's name alone takes one second; an exception is raised, as by a skill that breaks."""
Replies = Reply | Sequence[Reply] | Callable[[Call], Reply]
"""The same answer to every call, one for each call in order, or whatever a function makes of the call."""


class ScriptedSkills:
    """A robot made of answers.

    Args:
        knowledge: the world model of the run; effects in answers are applied to what it knows.
        script: `component.skill` -> what it answers.
        like: components whose skills are imitated: only what they declare is answered, and only with the arguments
            that they take can they be called. A component that is not among them takes any arguments.

    Attributes:
        components: to be deployed in place of the real ones.
        calls: what was called, in order.
        problems: where the script and the run did not fit; see `check`.

    Raises:
        InputError: the script names a skill, outcome or attribute that a component in `like` does not have.
    """

    def __init__(
        self, knowledge: KnowledgeBase, script: Mapping[str, Replies], like: Iterable[Component] = ()
    ) -> None:
        self.knowledge = knowledge
        self.calls: list[Call] = []
        self.problems: list[InputError] = []
        self._replies = {skill: _Replies(skill, replies) for skill, replies in script.items()}
        imitated = {component.name: component.skills() for component in like}
        names = dict.fromkeys([*imitated, *(_component(skill) for skill in script)])
        self.components = tuple(_ScriptedComponent(name, self, imitated.get(name)) for name in names)
        for component in self.components:
            for skill, replies in self._replies.items():
                if _component(skill) == component.name:
                    component.check(skill, replies.known)

    def check(self) -> None:
        """Raise the first problem of the script: a call without an answer, an answer that is none of the skill's."""
        if self.problems:
            raise self.problems[0]

    def reply(self, call: Call) -> Answer | Exception:
        """The answer to a call.

        Raises:
            UnknownNameError: the script does not have the skill.
            InputError: it has no further answer.
        """
        self.calls.append(call)
        if call.skill not in self._replies:
            raise UnknownNameError(
                f"the script has no skill '{call.skill}'", found=call.skill, valid=self._replies
            )
        return self._replies[call.skill].next(call)


class _Replies:
    """The answers of one skill; `known` are those that can be seen before any call."""

    def __init__(self, skill: str, replies: Replies) -> None:
        self._skill = skill
        self._given = 0
        self._always: Callable[[Call], Reply] | None = None
        in_order: Sequence[Reply] = ()
        if isinstance(replies, str | Answer | Exception):
            self._always = lambda _call: replies
            in_order = (replies,)
        elif isinstance(replies, Sequence):
            in_order = replies
        else:
            self._always = replies
        self._in_order = tuple(map(_answer, in_order))
        self.known = tuple(one for one in self._in_order if isinstance(one, Answer))

    def next(self, call: Call) -> Answer | Exception:
        if self._always is not None:
            return _answer(self._always(call))
        self._given += 1
        if self._given > len(self._in_order):
            raise InputError(f"the script of '{self._skill}' has no answer to call {self._given}")
        return self._in_order[self._given - 1]


class _ScriptedComponent(Component):
    """One component of the script, imitating another's skills or free."""

    def __init__(
        self, name: str, script: ScriptedSkills, imitated: Mapping[str, SkillSignature] | None
    ) -> None:
        super().__init__(name)
        self._script = script
        self._imitates = imitated is not None
        self._signatures = dict(imitated or {})

    def skills(self) -> dict[str, SkillSignature]:
        """The imitated skills, or those of the script as far as they are known."""
        return self._signatures

    async def execute(self, skill_name: str, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
        """Take the time that the script says, and answer."""
        made = Call(f"{self.name}.{skill_name}", dict(arguments), call.clock.now())
        try:
            if skill_name in self._signatures and self._imitates:
                check_arguments(self._signatures[skill_name], arguments)
            answer = self._script.reply(made)
            if isinstance(answer, Exception):
                raise answer
            self.check(made.skill, (answer,))
        except InputError as problem:
            self._script.problems.append(problem)
            raise
        for report in answer.reports:
            await call.clock.sleep(report.after)
            call.report(self._outcome(report, made))
        await call.clock.sleep(answer.after)
        return self._outcome(answer, made)

    def check(self, skill: str, answers: Iterable[Answer]) -> None:
        """Whether the skill may answer so; a free one may answer anything, and declares it from now on.

        Raises:
            InputError: it may not.
        """
        name = skill.partition(".")[2]
        if not self._imitates:
            self._signatures.setdefault(name, SkillSignature(self.name, name, {}, {}, {}))
        if name not in self._signatures:
            raise UnknownNameError(
                f"component '{self.name}' has no skill '{name}'", found=name, valid=self._signatures
            )
        for answer in (one for whole in answers for one in (*whole.reports, whole)):
            if self._imitates:
                _check_outcome(skill, self._signatures[name], answer)
            else:
                signature = self._signatures[name]
                outcomes = {**signature.outcomes, answer.event: dict.fromkeys(answer.attributes)}
                self._signatures[name] = replace(signature, outcomes=outcomes)

    def _outcome(self, answer: Answer, call: Call) -> Outcome:
        try:
            observed = change_of(answer.observed, self._script.knowledge, call.arguments)
        except InputError as problem:
            self._script.problems.append(problem)
            raise
        return Outcome(answer.event, answer.attributes, observed)


def _component(skill: str) -> str:
    component, dot, name = skill.partition(".")
    if not (component and dot and name):
        raise ParseError(f"a script names skills as COMPONENT.SKILL, not '{skill}'", found=skill)
    return component


def _answer(reply: Reply) -> Answer | Exception:
    return Answer(reply) if isinstance(reply, str) else reply


def _check_outcome(skill: str, signature: SkillSignature, answer: Answer) -> None:
    if answer.event not in signature.outcomes:
        raise UnknownNameError(
            f"skill '{skill}' has no outcome '{answer.event}'", found=answer.event, valid=signature.outcomes
        )
    declared = signature.outcomes[answer.event]
    for name in answer.attributes:
        if name not in declared:
            unknown = f"the outcome '{answer.event}' of '{skill}' has no attribute '{name}'"
            raise UnknownNameError(unknown, found=name, valid=declared)
    missing = [name for name in declared if name not in answer.attributes]
    if missing:
        raise InputError(f"the outcome '{answer.event}' of '{skill}' needs its attribute '{missing[0]}'")
