"""Components with scripted skills, which answer by the test's script and record their calls."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from dsc.calls import Outcome, SkillCall
from dsc.components.component import Component
from dsc.skills import SkillSignature, check_arguments
from dsc.testing.answers import Answer, Call, Replies, RepliesOfSkill, check_outcome
from dsc.testing.worlds import change_of
from knowledge_base.errors import ParseError, UnknownNameError
from knowledge_base.store import KnowledgeBase


class ScriptedSkills:
    """A robot with scripted answers.

    Args:
        knowledge: the world model of the run; effects in answers apply to it.
        script: `component.skill` -> its answers.
        like: components to imitate: their skills accept only the declared arguments and give only declared answers. A
            component outside this list accepts any arguments.

    Attributes:
        components: replacements for the real ones, to be deployed.
        calls: the calls, in order.
        problems: mismatches of script and run, and exceptions of the script's functions; see `check`.

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
        """Raise the first problem: a call without an answer, an answer that is not the skill's, a failed assertion.

        To the plot such a skill has merely failed, and the plot may handle the failure.
        """
        if self.problems:
            raise self.problems[0]

    def reply(self, call: Call) -> Answer | Exception:
        """Return the answer to a call.

        Raises:
            UnknownNameError: the script does not have the skill.
            InputError: it has no further answer.
        """
        self.calls.append(call)
        if call.skill not in self._replies:
            raise UnknownNameError(f"the script has no skill '{call.skill}'", found=call.skill, valid=self._replies)
        return self._replies[call.skill].next(call)


class _ScriptedComponent(Component):
    """One component of the script, which imitates another's skills or is free."""

    def __init__(self, name: str, script: ScriptedSkills, imitated: Mapping[str, SkillSignature] | None) -> None:
        super().__init__(name)
        self._script = script
        self._imitates = imitated is not None
        self._signatures = dict(imitated or {})
        self._outcomes: dict[str, dict[str, dict[str, str | None]]] = {}  # of a free one; they grow with its answers

    def skills(self) -> dict[str, SkillSignature]:
        """Return the imitated skills, or the known ones of the script."""
        return self._signatures

    async def execute(self, skill_name: str, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
        """Wait for the scripted time, and answer."""
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
        """Check an answer of the skill; a free one may give any answer, and declares it from now on.

        Raises:
            InputError: the skill does not have this answer.
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
        self.check(call.skill, (answer,))  # a free one declares it again: attributes may differ
        return Outcome(answer.event, answer.attributes, observed)


def _component(skill: str) -> str:
    component, dot, name = skill.partition(".")
    if not (component and dot and name):
        raise ParseError(f"a script names skills as COMPONENT.SKILL, not '{skill}'", found=skill)
    return component
