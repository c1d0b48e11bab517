"""Conditions on the values that a component pushes, evaluated where the values are (S2.4).

`(and (< scan.metres 0.5) (not (silent scan 2)))` reads the values as `port.value`. A condition is unknown until each
value that it reads has arrived; then, only changes of its truth leave the component.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from dsc.calls import SkillCall
from dsc.components.checks import LIBRARY, Check, Series, by_name
from dsc.components.hooks import contained
from dsc.components.streams import Push
from dsc.components.value_evaluation import ValueEvaluation
from dsc.components.value_vocabulary import ValueVocabulary, kinds_of
from dsc.outcomes import Outcome
from dsc.skills import Declared, SkillBody
from knowledge_base.conditions.damping import relaxed
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.expression import Atom, Constant, Expression
from knowledge_base.language.syntax.rewriting import inside
from knowledge_base.language.syntax.text import parse_condition

WATCH = "watch_values"
"""Name of the skill by which charts watch a condition on the values of a component with push ports."""
WATCH_TYPES = {
    "condition": "text", "values": "map of any", "hysteresis": "number from 0", "hold": "number from 0",
}  # fmt: skip
"""Types of the parameters of events that watch a condition."""
WATCH_OUTCOMES = {"became_true": {"values": "map of any"}, "became_false": {"values": "map of any"}}
"""Outcomes of events that watch a condition."""
Flip = Callable[[bool, dict[str, Any]], None]
"""Function that receives the truth of a condition after each change, and the values that it reads."""
Fail = Callable[[Exception], None]
"""Function that receives the error of an evaluation, after which the condition is not evaluated again."""


class ValueCondition:
    """A condition on the values of push ports, which reports its changes in the running loop.

    Args:
        condition: the condition; a name with a dot is a value of a port, e.g. `scan.metres`.
        ports: the push ports by name.
        checks: the functions that the condition may use, by name.
        values: the values of the variables in the condition, until `replace_values`.
        hysteresis: as for `KnowledgeBase.install`; 0 means none.
        hold: seconds for which the condition must stay true before it counts as true.
        times, out_of: the condition counts as true if it is true for `times` of the last `out_of` values.

    Raises:
        InputError: the text is not such a condition, or a number is invalid.
        UnknownNameError: there is no such port, value, check or variable.
    """

    def __init__(
        self,
        condition: str | Expression,
        ports: Mapping[str, Push],
        checks: Mapping[str, Check],
        values: Mapping[str, Any],
        *,
        hysteresis: float = 0.0,
        hold: float = 0.0,
        times: int = 1,
        out_of: int = 1,
    ) -> None:
        self._ports, self._checks = ports, checks
        rise = parse_condition(condition, "condition") if isinstance(condition, str) else condition
        pushed = {name: port.values for name, port in ports.items()}
        ValueVocabulary(pushed, checks, kinds_of(values), "the component pushes no").check(rise)
        self._rise, self._stay = rise, relaxed(rise, hysteresis) if hysteresis else rise
        require_times(times, out_of)
        if hold < 0:
            raise InputError(f"`hold` is a number of seconds, 0 or more, not {hold:g}")
        self._hold, self._times, self._last = hold, times, deque[bool](maxlen=out_of)
        self._series: dict[str, Series] = {}
        self._silences: dict[tuple[str, float], float] = {}  # loop times of the end of silence that counts
        for form in inside(rise):
            match form:
                case Constant(str(name), False) if port_of(name) in ports:
                    self._series[name] = Series(name)
                case Atom("silent", (Constant(port), Constant(seconds))):
                    self._silences[str(port), float(seconds)] = 0.0
                case _:
                    pass
        self._read = dict.fromkeys([*map(port_of, self._series), *(p for p, _ in self._silences)])
        self._values = dict(values)
        self._evaluation = ValueEvaluation(self._series, checks, self._values, self._is_silent)
        self._truth: bool | None = None
        self._since: float | None = None  # loop time since which the condition is true
        self._timers: list[asyncio.TimerHandle] = []
        self._flip: Flip | None = None
        self._fail: Fail | None = None
        self._receivers: list[tuple[Push, Callable[[dict[str, Any], float], None]]] = []

    def listen(self, flip: Flip, fail: Fail) -> None:
        """Call `flip` with the first truth and each later change, until `end`; must be called in a running loop."""
        self._flip, self._fail = flip, fail
        now = asyncio.get_running_loop().time()
        for silence in self._silences:
            self._silences[silence] = now + silence[1]
        for name in self._read:
            port = self._ports[name]
            receive = self._receiver(name)
            self._receivers.append((port, receive))
            port.listen(receive)
        if not self._series:
            self._evaluate()

    def replace_values(self, values: Mapping[str, Any]) -> None:
        """Replace values of variables, and evaluate the condition again; must be called in the loop of `listen`."""
        self._values.update(values)
        self._evaluate()

    def end(self) -> None:
        """Stop listening."""
        self._flip = self._fail = None
        for port, receive in self._receivers:
            port.leave(receive)
        for timer in self._timers:
            timer.cancel()

    def _receiver(self, port: str) -> Callable[[dict[str, Any], float], None]:
        def receive(values: dict[str, Any], age: float) -> None:
            at = asyncio.get_running_loop().time() - age
            for name, value in values.items():
                series = self._series.get(f"{port}.{name}")
                if series is not None:
                    series.kept.append((at, value))
            for silence in self._silences:
                if silence[0] == port:
                    self._silences[silence] = at + silence[1]
            self._evaluate(by_value=True)

        return receive

    def _evaluate(self, *, by_value: bool = False) -> None:
        if self._flip is None or self._fail is None or not all(series.kept for series in self._series.values()):
            return
        try:
            with contained():
                self._report(self._flip, by_value=by_value)
        except Exception as error:  # noqa: BLE001  # the error fails this condition, not the caller of `put`
            self._fail(error)
            self.end()

    def _report(self, flip: Flip, *, by_value: bool) -> None:
        """Report a change of the truth, and schedule the next evaluation that depends on time."""
        now = asyncio.get_running_loop().time()
        holds = self._evaluation.is_true(self._stay if self._truth else self._rise)
        if by_value or not self._last:
            self._last.append(holds)
        truth = holds if self._last.maxlen == 1 else sum(self._last) >= self._times
        self._since = (now if self._since is None else self._since) if truth else None
        if truth and not self._truth and self._since is not None and now < self._since + self._hold:
            truth = False
        if truth is not self._truth:
            self._truth = truth
            flip(truth, {name: series.newest for name, series in self._series.items()})
        self._schedule(now)

    def _schedule(self, now: float) -> None:
        for timer in self._timers:
            timer.cancel()
        due = [at for at in self._silences.values() if at > now]
        if self._since is not None and not self._truth:
            due.append(self._since + self._hold)
        loop = asyncio.get_running_loop()
        self._timers = [loop.call_at(at, self._evaluate) for at in due]

    def _is_silent(self, port: str, seconds: float) -> bool:
        return asyncio.get_running_loop().time() >= self._silences[port, seconds]


def require_times(times: Any, out_of: Any) -> None:
    """Raise `InputError` unless a condition can be true for `times` of the last `out_of` values."""
    if isinstance(times, int) and isinstance(out_of, int) and not 1 <= times <= out_of:
        raise InputError(f"`times` is from 1 to `out_of`, not {times} of {out_of}; write both: `times: 3, out_of: 5`")


def port_of(name: str) -> str:
    """Return the port of a value's name: `scan` of `scan.metres`."""
    return name.rpartition(".")[0]


def own_checks(ports: Iterable[Push]) -> Mapping[str, Check]:
    """Return the checks that the ports add to the library, by name."""
    return by_name(*(check for port in ports for check in port.checks))


def checks_of(ports: Iterable[Push]) -> dict[str, Check]:
    """Return the checks that conditions on values of these ports may use, by name."""
    return {**LIBRARY, **own_checks(ports)}


class BecameTrue(Outcome):
    """The condition has become true, or is true at the beginning."""

    values: dict[str, Any]


class BecameFalse(Outcome):
    """The condition has become false, or is false at the beginning."""

    values: dict[str, Any]


async def watch(component: Any, _: SkillBody, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
    """Report each change of a condition's truth until the action is cancelled, or an evaluation fails."""
    failed: asyncio.Future[Outcome] = asyncio.get_running_loop().create_future()
    options = {name: value for name, value in arguments.items() if name not in {"condition", "values"}}
    ports, values = component.pushes, arguments.get("values", {})
    condition = ValueCondition(arguments["condition"], ports, checks_of(ports.values()), values, **options)
    component.activations.conditions[call.key] = condition
    condition.listen(
        lambda truth, values: call.report(BecameTrue(values=values) if truth else BecameFalse(values=values)),
        lambda error: None if failed.done() else failed.set_exception(error),
    )
    try:
        return await failed
    finally:
        del component.activations.conditions[call.key]
        condition.end()


def declare_watch(body: SkillBody) -> SkillBody:
    """Declare the method that stands for the conditions of a component as an event with two outcomes."""
    types = {**WATCH_TYPES, "times": "integer from 1", "out_of": "integer from 1"}
    return Declared(types, WATCH_OUTCOMES, watch, own=1, pattern="event", after_crash="repeat")(body)
