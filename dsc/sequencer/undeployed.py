"""Outputs for components that are not deployed yet; they wait, as a skill waits for its needs (S2.12)."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import partial

from dsc.engine.steps import Start
from dsc.messages import SkillMessage, Told
from dsc.run_log import run_logger
from dsc.sequencer.clock import LoopClock, ScheduledCall
from dsc.sequencer.message_checks import faulty, late
from dsc.sequencer.outbox import command
from knowledge_base.errors import UnknownNameError

_LOG = run_logger(__package__)


@dataclass(slots=True)
class Held:
    """An output that waits for its component since second `at`; a skill has a timer for its time limit."""

    output: Start | Told
    at: float
    timer: ScheduledCall | None = None


def no_component(name: str, deployed: Collection[str]) -> UnknownNameError:
    """Return the error for a component that is not among the deployed ones."""
    return UnknownNameError(f"there is no component '{name}'", found=name, valid=deployed)


class Undeployed:
    """The outputs that wait for their components, in the order of their dispatch.

    Args:
        clock: run time.
        post: receives the end of a skill whose component was not deployed within the skill's time limit.
        refuse: receives a command without a component, after the last deployment.
        deployed: names of the deployed components.

    Attributes:
        complete: whether no further component will be deployed, so that outputs fail instead of waiting.
    """

    def __init__(
        self,
        clock: LoopClock,
        post: Callable[[SkillMessage], None],
        refuse: Callable[[Told, Exception], None],
        deployed: Collection[str],
    ) -> None:
        self.complete = False
        self._clock = clock
        self._post = post
        self._refuse = refuse
        self._deployed = deployed
        self._held: list[Held] = []

    def __bool__(self) -> bool:
        return bool(self._held)

    @property
    def waiting(self) -> bool:
        """Whether a skill waits, whose time limit will end."""
        return any(one.timer is not None for one in self._held)

    @property
    def commands(self) -> list[Told]:
        """The commands that wait."""
        return [one.output for one in self._held if not isinstance(one.output, Start)]

    def hold(self, output: Start | Told, within: float) -> None:
        """Let an output wait for its component; a skill ends with `timed_out` after `within` seconds."""
        if self.complete:
            self._fail(output)
            return
        held = Held(output, self._clock.now())
        self._held.append(held)
        _LOG.warning("%s", self._describe(held))
        if isinstance(output, Start) and math.isfinite(within):
            held.timer = self._clock.call_at(held.at + within, partial(self._expire, held, within))

    def _fail(self, output: Start | Told) -> None:
        missing = no_component(output.component, self._deployed)
        if isinstance(output, Start):
            self._post(SkillMessage(output, faulty(output, str(missing)), final=True))
        else:
            self._refuse(output, missing)

    def describe(self) -> Iterator[str]:
        """Yield each output with its reason to wait, as text."""
        return map(self._describe, self._held)

    def _describe(self, held: Held) -> str:
        output = held.output
        what = f"{output.component}.{output.skill}" if isinstance(output, Start) else command(output)
        return f"{what} waits: {self._reason(output)}"

    def _reason(self, output: Start | Told) -> str:
        return str(no_component(output.component, self._deployed))

    def _expire(self, held: Held, within: float) -> None:
        self._held.remove(held)
        assert isinstance(held.output, Start)  # noqa: S101  # only skills have timers
        waited = f"for its component: {self._reason(held.output)}"
        self._post(SkillMessage(held.output, late(held.output, within, waited), final=True))

    def cancel(self, activation: int) -> None:
        """Drop the skills of a state that was left."""
        if not self._held:  # the common case
            return
        self._drop(lambda one: isinstance(one, Start) and one.activation == activation)

    def release(self, component: str) -> Iterator[Held]:
        """Yield the outputs for a component that is deployed now, which no longer wait."""
        yield from self._drop(lambda one: one.component == component)

    def close(self) -> Iterator[str]:
        """Yield the reasons of the commands that no component has received, and drop all outputs."""
        for one in self._drop(lambda _: True):
            if not isinstance(one.output, Start):
                yield f"{command(one.output)}: {self._reason(one.output)}"

    def _drop(self, concerns: Callable[[Start | Told], bool]) -> list[Held]:
        dropped = [one for one in self._held if concerns(one.output)]
        self._held = [one for one in self._held if not concerns(one.output)]
        for one in dropped:
            if one.timer is not None:
                one.timer.cancel()
        return dropped
