"""Ports of a component besides its skills: events, queries, one-way messages (S1.1). Charts reach all of them.

    class Battery(Component):
        @event({"level": "number"})
        def low(self, level: float, below: float = 20.0) -> dict[str, Any] | None:
            return {"level": level} if level < below else None

        @query({"hours": "number"})
        async def lasts(self, watts: float) -> dict[str, Any]: ...

        @takes
        async def calibrate(self, full: float) -> None: ...

`self.update("low", 17.5)` puts a new value before everybody who has activated the event.
"""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from dsc.calls import Outcome, SkillCall
from dsc.components.component import TAKES, Component
from dsc.components.hooks import contained
from dsc.skills import Declared, SkillBody, Skilled, require_names

ANSWERED = "answered"
"""The outcome of a query; its attributes are the answer."""
_Body = TypeVar("_Body", bound=Callable[..., Any])


def query(answer: Mapping[str, str | None], types: Mapping[str, str] | None = None) -> Callable[[_Body], _Body]:
    """Declare a coroutine method that is asked something: `async def lasts(self, watts)` gives the answer's values.

    A chart asks with `trigger`, gets the event `answered`, and says `within` which time.
    """
    require_names(answer, "the values of an answer", "@query({'hours': 'number'})")
    return Declared(dict(types or {}), {ANSWERED: dict(answer)}, _ask, own=1, pattern="query", after_crash="repeat")


def event(attributes: Mapping[str, str | None], types: Mapping[str, str] | None = None) -> Callable[[_Body], _Body]:
    """Declare an event that charts activate with parameters, under a name that they choose (S0.6).

    The method below it is the event's test: it is called for each activation whenever the component says `update`,
    with the values said there and the activation's parameters, and gives the event's attributes or `None`. The event
    comes each time the test begins to hold. A chart activates it with `trigger`, until it leaves the state; the event
    has the method's name and can be renamed with `as`. With `within`, the event `timed_out` ends the activation.

    Args:
        attributes: the event's, with types.
        types: of the activation's parameters; these stand after those for the value, and have defaults.
    """
    require_names(attributes, "the attributes of an event", "@event({'level': 'number'})")

    def declare(test: _Body) -> _Body:
        return Declared(
            dict(types or {}), {test.__name__: dict(attributes)}, _activate,
            own=_values_of(test), pattern="event", after_crash="repeat",
        )(test)  # fmt: skip

    return declare


def takes(body: _Body) -> _Body:
    """Declare a coroutine method that takes a one-way message: `send: voice.say` in a chart."""
    setattr(body, TAKES, Declared({}, {}, _ask, own=1))
    return body


async def _ask(_: Skilled, body: SkillBody, __: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
    return Outcome(ANSWERED, await body(**arguments))


async def _activate(component: Skilled, body: SkillBody, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
    """Test each value until we are cancelled, or the test fails."""
    assert isinstance(component, Component)  # noqa: S101  # events are methods of components
    held = False
    forever: asyncio.Future[Outcome] = asyncio.get_running_loop().create_future()

    def test(*values: Any) -> None:
        nonlocal held
        try:
            with contained():
                found = body(*values, **arguments)
            if found is not None and not held:
                call.report(Outcome(body.__name__, found))
            held = found is not None
        except Exception as error:  # noqa: BLE001  # our affair, and not that of who has the value
            if not forever.done():
                forever.set_exception(error)

    with component.activations.tested(body.__name__, test):
        return await forever


def _values_of(test: Callable[..., Any]) -> int:
    """How many of the test's first parameters are not the activation's: `self` and those without default."""
    return sum(p.default is inspect.Parameter.empty for p in inspect.signature(test).parameters.values())
