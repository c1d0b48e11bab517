"""Ports of a component besides its skills: events, queries and one-way messages, as decorators (S1.1).

```python
class Battery(Component):
    @event({"level": "number"})
    def low(self, level: float, below: float = 20.0) -> dict[str, Any] | None:
        return {"level": level} if level < below else None

    @query({"hours": "number"})
    async def lasts(self, watts: float) -> dict[str, Any]: ...

    @takes
    async def calibrate(self, full: float) -> None: ...
```

`self.update("low", 17.5)` passes a new value to the test `low`, for each activation of the event.
"""

from __future__ import annotations

import asyncio
import inspect
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar

from dsc.calls import Outcome, SkillCall
from dsc.components.hooks import contained
from dsc.skills import Declared, SkillBody, require_names

ANSWERED = "answered"
"""The outcome of a query; its attributes are the answer."""
TAKES = "__dsc_takes__"
"""Name of the attribute in which `takes` stores its declaration."""
_Body = TypeVar("_Body", bound=Callable[..., Any])
Test = Callable[..., None]
"""Function that receives each new value of an event."""


def query(answer: Mapping[str, str | None], types: Mapping[str, str] | None = None) -> Callable[[_Body], _Body]:
    """Declare a coroutine method as a query, e.g. `async def lasts(self, watts)`.

    The method returns the values of the answer by name. A chart starts the query with `trigger` and a time `within`.
    The event `answered` carries the answer.

    Args:
        answer: names and types of the answer's values.
        types: types of the query's parameters by name, as for `skill`.
    """
    require_names(answer, "the values of an answer", "@query({'hours': 'number'})")
    return Declared(dict(types or {}), {ANSWERED: dict(answer)}, _ask, own=1, pattern="query", after_crash="repeat")


def event(attributes: Mapping[str, str | None], types: Mapping[str, str] | None = None) -> Callable[[_Body], _Body]:
    """Declare an event that charts activate with parameters, under a name that they choose (S0.6).

    The decorated method is the event's test. For each activation, `update` calls the test with the new values and the
    activation's parameters. The test returns the event's attributes, or `None` if the condition is false. The event is
    posted each time the test changes from `None` to attributes. A chart activates the event with `trigger`, until the
    state is left. The event has the method's name unless the chart renames it with `as`. With `within`, the event
    `timed_out` ends the activation.

    Args:
        attributes: the event's attributes, with types.
        types: types of the activation's parameters. In the method, the activation's parameters follow those for values,
            and have defaults.
    """
    require_names(attributes, "the attributes of an event", "@event({'level': 'number'})")

    def declare(test: _Body) -> _Body:
        parameters = inspect.signature(test).parameters.values()
        return Declared(
            dict(types or {}), {test.__name__: dict(attributes)}, _activate, pattern="event", after_crash="repeat",
            own=sum(one.default is inspect.Parameter.empty for one in parameters),
        )(test)  # fmt: skip

    return declare


def takes(body: _Body) -> _Body:
    """Declare a coroutine method that receives one-way messages, e.g. `send: voice.say` in a chart."""
    setattr(body, TAKES, Declared({}, {}, _ask, own=1))
    return body


class EventActivations:
    """Tests of a component's active events, and the last values of each event (S0.6)."""

    def __init__(self) -> None:
        self._values: dict[str, tuple[Any, ...]] = {}
        self._tests: defaultdict[str, list[Test]] = defaultdict(list)

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling, without activations, which stay in this process."""
        return {"_values": self._values, "_tests": defaultdict(list)}

    def active(self, event: str) -> bool:
        """Return whether the event has an activation."""
        return bool(self._tests[event])

    def update(self, event: str, values: tuple[Any, ...]) -> None:
        """Store the event's values, and call all its tests with them."""
        self._values[event] = values
        for test in tuple(self._tests[event]):
            test(*values)

    @contextmanager
    def tested(self, event: str, test: Test) -> Iterator[None]:
        """Call the test with the event's present values, if any, and inside the block with each update."""
        self._tests[event].append(test)
        try:
            if event in self._values:
                test(*self._values[event])
            yield
        finally:
            self._tests[event].remove(test)


async def _ask(_: Any, body: SkillBody, __: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
    return Outcome(ANSWERED, await body(**arguments))


async def _activate(component: Any, body: SkillBody, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
    """Test each new value until the action is cancelled or the test raises an error."""
    held = False
    failed: asyncio.Future[Outcome] = asyncio.get_running_loop().create_future()

    def test(*values: Any) -> None:
        nonlocal held
        try:
            with contained():
                found = body(*values, **arguments)
            if found is not None and not held:
                call.report(Outcome(body.__name__, found))
            held = found is not None
        except Exception as error:  # noqa: BLE001  # the error fails this activation, not the caller of `update`
            if not failed.done():
                failed.set_exception(error)

    activations: EventActivations = component.activations
    with activations.tested(body.__name__, test):
        return await failed
