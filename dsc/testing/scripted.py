"""Components whose skills answer what the test has laid down, and remember how they were called."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from dsc.calls import Outcome, SkillCall
from dsc.components.component import Component
from dsc.skills import SkillSignature, check_arguments
from dsc.testing.answers import Answer, Call, Replies, RepliesOfSkill, check_outcome
from dsc.testing.worlds import change_of
from knowledge_base.errors import ParseError, UnknownNameError
from knowledge_base.store import KnowledgeBase


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
        problems: where the script and the run did not fit, and what functions of the script raised; see `check`.

    Raises:
        InputError: the script names a skill, outcome or attribute that a component in `like` does not have.
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
        """Raise the first problem: a call without an answer, an answer that is none of the skill's, a failed assertion.

        Seen from the plot such a skill has merely broken, and the plot may well cope with that.
        """
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
            raise UnknownNameError(f"the script has no skill '{call.skill}'", found=call.skill, valid=self._replies)
        return self._replies[call.skill].next(call)


class _ScriptedComponent(Component):
    """One component of the script, imitating another's skills or free."""

    def __init__(self, name: str, script: ScriptedSkills, imitated: Mapping[str, SkillSignature] | None) -> None:
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
        """Whether the skill may answer so; a free one may answer anything, and declares it from now on.

        Raises:
            InputError: it may not.
        """
        name = skill.partition(".")[2]
        if not self._imitates:
            self._signatures.setdefault(name, SkillSignature(self.name, name, {}, {}, {}))
        if name not in self._signatures:
            raise UnknownNameError(f"component '{self.name}' has no skill '{name}'", found=name, valid=self._signatures)
        for answer in (one for whole in answers for one in (*whole.reports, whole)):
            if self._imitates:
                check_outcome(skill, self._signatures[name], answer)
            else:
                signature = self._signatures[name]
                outcomes = {**signature.outcomes, answer.event: dict.fromkeys(answer.attributes)}
                self._signatures[name] = replace(signature, outcomes=outcomes)

    def _outcome(self, answer: Answer, call: Call) -> Outcome:
        try:
            observed = change_of(answer.observed, self._script.knowledge, call.arguments)
        except Exception as problem:
            self._script.problems.append(problem)
            raise
        self.check(call.skill, (answer,))  # a free one declares it anew: other answers may have had other attributes
        return Outcome(answer.event, answer.attributes, observed)


def _component(skill: str) -> str:
    component, dot, name = skill.partition(".")
    if not (component and dot and name):
        raise ParseError(f"a script names skills as COMPONENT.SKILL, not '{skill}'", found=skill)
    return component
