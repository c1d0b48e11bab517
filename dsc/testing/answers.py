"""Scripted skills' answers, and the calls of these skills."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from dsc.skills import SkillSignature
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Delta


@dataclass(frozen=True, slots=True)
class Answer:
    """The end of a scripted skill.

    Attributes:
        event: its outcome event.
        attributes: the event's attributes.
        after: its duration in seconds of run time; `math.inf` means that it never ends by itself.
        observed: knowledge that comes with the outcome: a change, or a PDDL effect. In an effect such as
            `(holding ?item)`, `?name` stands for an argument of the call.
        reports: its intermediate reports, each `after` the one before.
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
"""An answer; an outcome's name alone takes one second; an exception is raised, as by a defective skill."""
Replies = Reply | Sequence[Reply] | Callable[[Call], Reply]
"""The same answer to every call, one for each call in order, or the result of a function of the call."""


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
    """Raise an error if a skill of that signature cannot give the answer.

    Raises:
        UnknownNameError: it has no such outcome, or the outcome no such attribute.
        InputError: an attribute is missing.
    """
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
