"""Components with scripted skills, which answer as the test's script declares and record their calls."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.outcomes import Outcome
from dsc.skills import SkillSignature, check_arguments
from dsc.testing.fixtures import change_of, require_attributes
from knowledge_base.errors import InputError, ParseError, UnknownNameError
from knowledge_base.facts import Delta
from knowledge_base.store import KnowledgeBase


class ScriptedSkills:
    """A robot with scripted answers.

    Args:
        knowledge: the world model of the run; effects in answers apply to it.
        script: answers by skill (`component.skill`).
        like: components to imitate: their skills accept only declared arguments and return only declared answers. A
            component outside this list accepts any arguments.

    Attributes:
        components: the replacements of the real components, to be deployed.
        calls: the calls, in order.
        problems: mismatches of script and run, and exceptions of the script's functions; see `check`.

    Raises:
        InputError: the script has a skill, outcome or attribute that a component in `like` lacks.
    """

    def __init__(self, knowledge: KnowledgeBase, script: Mapping[str, Replies], like: Iterable[Component] = ()) -> None:
        self.knowledge = knowledge
        self.calls: list[Call] = []
        self.problems: list[Exception] = []
        self._replies = {skill: RepliesOfSkill(skill, replies) for skill, replies in script.items()}
        imitated = {component.name: component.skills() for component in like}
        names = dict.fromkeys([*imitated, *(_component(skill) for skill in script)])
        self.components = tuple(_ScriptedComponent(name, self, imitated.get(name)) for name in names)
        for component in self.components:
            for skill, replies in self._replies.items():
                if _component(skill) == component.name:
                    component.check(skill, replies.known)

    def check(self) -> None:
        """Raise the first problem, if any: a missing answer, an undeclared answer, or a failed assertion.

        For the plot, a skill with such a problem has merely failed, and the plot may handle the failure.
        """
        if self.problems:
            raise self.problems[0]

    def reply(self, call: Call) -> Answer | Exception:
        """Return the answer to a call.

        Raises:
            UnknownNameError: the script does not have the skill.
            InputError: the skill's script has no further answer.
        """
        self.calls.append(call)
        if call.skill not in self._replies:
            raise UnknownNameError(f"the script has no skill '{call.skill}'", found=call.skill, valid=self._replies)
        return self._replies[call.skill].next(call)


class _ScriptedComponent(Component):
    """One component of the script, which imitates the skills of another component, or accepts any call."""

    def __init__(self, name: str, script: ScriptedSkills, imitated: Mapping[str, SkillSignature] | None) -> None:
        super().__init__(name)
        self._script = script
        self._imitates = imitated is not None
        self._signatures = dict(imitated or {})
        self._outcomes: dict[str, dict[str, dict[str, str | None]]] = {}  # of a free component; its answers extend it

    def skills(self) -> dict[str, SkillSignature]:
        """Return the imitated skills, or the skills of the script that are known so far."""
        return self._signatures

    async def execute(self, skill_name: str, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
        """Wait for the scripted duration, and return the scripted outcome."""
        made = Call(f"{self.name}.{skill_name}", dict(arguments), call.clock.now())
        answer = self._reply(skill_name, made)
        if isinstance(answer, Exception):
            raise answer
        for report in answer.reports:
            await call.clock.sleep(report.after)
            call.report(self._outcome(report, made))
        await call.clock.sleep(answer.after)
        return self._outcome(answer, made)

    def _reply(self, skill_name: str, call: Call) -> Answer | Exception:
        try:
            if self._imitates and skill_name in self._signatures:
                check_arguments(self._signatures[skill_name], call.arguments)
            answer = self._script.reply(call)
            if isinstance(answer, Answer):
                self.check(call.skill, (answer,))
        except Exception as problem:
            self._script.problems.append(problem)
            raise
        return answer

    def check(self, skill: str, answers: Iterable[Answer]) -> None:
        """Check answers of the skill; a component that imitates no other declares any answer from now on.

        Raises:
            InputError: the imitated skill does not declare an outcome of this name.
        """
        name = skill.partition(".")[2]
        if not self._imitates and name not in self._signatures:
            self._outcomes[name] = {}
            self._signatures[name] = SkillSignature(self.name, name, {}, {}, self._outcomes[name])
        if name not in self._signatures:
            raise UnknownNameError(f"component '{self.name}' has no skill '{name}'", found=name, valid=self._signatures)
        for answer in (one for whole in answers for one in (*whole.reports, whole)):
            if self._imitates:
                check_outcome(skill, self._signatures[name], answer)
            else:
                self._outcomes[name][answer.event] = dict.fromkeys(answer.attributes)

    def _outcome(self, answer: Answer, call: Call) -> Outcome:
        try:
            observed = change_of(answer.observed, self._script.knowledge, call.arguments)
        except Exception as problem:
            self._script.problems.append(problem)
            raise
        self.check(call.skill, (answer,))  # a free component declares it again: attributes may differ
        return Outcome(answer.event, answer.attributes, observed)


def _component(skill: str) -> str:
    component, dot, name = skill.partition(".")
    if not (component and dot and name):
        raise ParseError(f"a script names skills as COMPONENT.SKILL, not '{skill}'", found=skill)
    return component


@dataclass(frozen=True, slots=True)
class Answer:
    """The end of a scripted skill.

    Attributes:
        event: the outcome event.
        attributes: the event's attributes.
        after: duration in seconds of run time; `math.inf` means that the skill never ends by itself.
        observed: the outcome's observations: a change, or a PDDL effect. In an effect such as `(holding ?item)`,
            `?name` is the value of an argument of the call.
        reports: intermediate reports; `after` of each counts from the report before.
    """

    event: str
    attributes: Mapping[str, Any] = field(default_factory=dict)
    after: float = 1.0
    observed: Delta | str = field(default_factory=Delta)
    reports: tuple[Answer, ...] = ()


@dataclass(frozen=True, slots=True)
class Call:
    """One call of a scripted skill: `component.skill`, its arguments, and its second of run time."""

    skill: str
    arguments: Mapping[str, Any]
    at: float


Reply = str | Answer | Exception
"""An answer of a scripted skill.

An outcome's name alone is an answer after one second. An exception is raised, as by a defective skill.
"""
Replies = Reply | Sequence[Reply] | Callable[[Call], Reply]
"""One answer to every call, a sequence with an answer for each call, or a function of the call."""


class RepliesOfSkill:
    """The answers of one skill, in sequence.

    Attributes:
        known: the answers that are known before any call.

    Raises:
        InputError: an answer is not a `Reply`.
    """

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
        self._in_order = tuple(map(self._answer, in_order))
        self.known = tuple(one for one in self._in_order if isinstance(one, Answer))

    def next(self, call: Call) -> Answer | Exception:
        """Return the answer to the next call; raise `InputError` if there is none."""
        if self._always is not None:
            return self._answer(self._always(call))
        self._given += 1
        if self._given > len(self._in_order):
            raise InputError(f"the script of '{self._skill}' has no answer to call {self._given}")
        return self._in_order[self._given - 1]

    def _answer(self, reply: Reply) -> Answer | Exception:
        if isinstance(reply, Answer | Exception):
            return reply
        if not isinstance(reply, str):
            raise InputError(
                f"the script of '{self._skill}' answers {reply!r}, which is not an outcome's name, Answer or exception"
            )
        return Answer(reply)


def check_outcome(skill: str, signature: SkillSignature, answer: Answer) -> None:
    """Raise an error if a skill of that signature cannot return the answer.

    Raises:
        UnknownNameError: the skill has no such outcome, or the outcome no such attribute.
        InputError: an attribute is missing.
    """
    if answer.event not in signature.outcomes:
        raise UnknownNameError(
            f"skill '{skill}' has no outcome '{answer.event}'", found=answer.event, valid=signature.outcomes
        )
    require_attributes(skill, answer.event, signature.outcomes[answer.event], answer.attributes)
