"""Which macrosteps share a commit."""

from __future__ import annotations

from collections.abc import Collection

from dsc.engine.steps import Output
from dsc.messages import Message, SkillMessage
from dsc.sequencer.inbox import Inbox
from dsc.sequencer.reactor import Reactor

MOST = 100
"""How many macrosteps one commit may hold."""


def may_wait(message: Message, output: Collection[Output], reactor: Reactor, inbox: Inbox) -> bool:
    """Whether the commit of the macrostep that was just made can wait for the next one, which can be made at once.

    Not if anything leaves after it; nor with answers of components, each of which is kept at once.
    """
    if output or not inbox or isinstance(message, SkillMessage) or isinstance(inbox.first, SkillMessage):
        return False
    return not reactor.machine.state.finished and reactor.problem is None
