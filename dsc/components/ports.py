"""Ports of a component besides its skills: events, queries and one-way messages, as decorators (S1.1).

```python
class Low(Outcome):
    level: float


class Lasts(Outcome):
    hours: float


class Battery(Component):
    @event
    def low(self, level: float, below: float = 20.0) -> Low | None:
        return Low(level=level) if level < below else None

    @query
    async def lasts(self, watts: float) -> Lasts:
        return Lasts(hours=50.0 / watts)

    @takes
    async def calibrate(self, full: float) -> None: ...
```

`self.update("low", 17.5)` passes a new value to the test `low`, for each activation of the event.
"""

from __future__ import annotations

import asyncio
import inspect
from collections import defaultdict
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

from dsc.annotations import FoundRecords, names_around, parameter_annotations, type_of
from dsc.calls import SkillCall
from dsc.components.hooks import contained
from dsc.loop_calls import LoopCalls
from dsc.outcomes import Outcome
from dsc.skills import (
    DECLARED,
    SkillBody,
    SkillSignature,
    declaration,
    refused_at,
    require_function,
    returned_outcomes,
    signature_of,
)
from knowledge_base.errors import InputError, SchemaError

if TYPE_CHECKING:
    from dsc.components.value_conditions import ValueCondition

ANSWERED = "answered"
"""The outcome of a query; its attributes are the answer."""
TAKES = "__dsc_takes__"
"""Name of the attribute in which `takes` stores its declaration."""
_Body = TypeVar("_Body", bound=Callable[..., Any])
_Asked = TypeVar("_Asked", bound=Callable[..., Awaitable[Outcome]])
_Test = TypeVar("_Test", bound=Callable[..., Outcome | None])
Test = Callable[..., None]
"""Function that receives each new value of an event."""


def query(body: _Asked) -> _Asked:
    """Declare a coroutine method as a query, e.g. `async def lasts(self, watts: float) -> Lasts`.

    The method returns an outcome class, whose attributes are the answer. A chart starts the query with `trigger` and a
    time `within`. The event `answered` carries the answer.

    Raises:
        SchemaError: the annotation of the method's return value is not one outcome class, or the method is not a
            coroutine.
    """
    require_function(body, "query")
    with refused_at(body) as name:
        _require_coroutine(body, f"query '{name}'")
        names = names_around(body.__globals__)
        records = FoundRecords()
        answers = list(returned_outcomes(body, names, records).values())
        if len(answers) != 1:
            raise SchemaError(f"query '{name}' returns one outcome class, the answer, not {len(answers)}")
        how = {"execute": _ask, "own": 1, "pattern": "query", "after_crash": "repeat"}
        return declaration(body, 1, names, {ANSWERED: answers[0]}, records, **how)(body)
    return body


def event(test: _Test) -> _Test:
    """Declare an event that charts activate with parameters, under a name that they choose (S0.6).

    The decorated method is the event's test. For each activation, `update` calls the test with the new values and the
    activation's parameters. The test returns an outcome class, the event, or `None` if the condition is false. The
    event is posted each time the test changes from `None` to an event. A chart activates the event with `trigger`,
    until the state is left. The event has the name of the class unless the chart renames it with `as`. With `within`,
    the event `timed_out` ends the activation.

    In the method, the activation's parameters follow those for values, and have defaults.

    Raises:
        SchemaError: the annotation of the method's return value is not one outcome class or `None`, or the method is a
            coroutine.
    """
    require_function(test, "event")
    with refused_at(test) as name:
        if inspect.iscoroutinefunction(inspect.unwrap(test)):
            raise SchemaError(f"event '{name}' is a coroutine, and its test is a plain function: write `def`")
        names = names_around(test.__globals__)
        own = sum(one.default is inspect.Parameter.empty for one in inspect.signature(test).parameters.values())
        records = FoundRecords()
        events = returned_outcomes(test, names, records, optional=True)
        if len(events) != 1:
            raise SchemaError(f"event '{name}' returns one outcome class or None, not {len(events)} classes")
        given = list(parameter_annotations(test, 1, names).items())[: own - 1]
        values = {value: type_of(annotation, records) for value, annotation in given}
        how = {"execute": _activate, "own": own, "pattern": "event", "after_crash": "repeat", "values": values}
        return declaration(test, own, names, events, records, **how)(test)
    return test


def takes(body: _Body) -> _Body:
    """Declare a coroutine method that receives one-way messages, e.g. `send: voice.say` in a chart.

    Raises:
        SchemaError: the method is not a coroutine.
    """
    require_function(body, "takes")
    with refused_at(body) as name:
        _require_coroutine(body, f"method '{name}' with `@takes`")
        names = names_around(body.__globals__)
        how = {"execute": _ask, "own": 1, "pattern": "message"}
        setattr(body, TAKES, declaration(body, 1, names, {}, FoundRecords(), **how))
    return body


def _require_coroutine(body: _Body, what: str) -> None:
    if not inspect.iscoroutinefunction(inspect.unwrap(body)):
        raise SchemaError(f"{what} is not a coroutine: write `async def`")


@cache
def messages(kind: type[object], name: str) -> Mapping[str, SkillSignature]:
    """Return the messages that a component class takes, by name, for a component with that `name`."""
    taking = inspect.getmembers(kind, lambda one: inspect.isfunction(one) and hasattr(one, TAKES))
    return {port: signature_of(name, port, body, getattr(body, TAKES)) for port, body in taking}


class EventActivations:
    """Tests of a component's active events, and the last values of each event (S0.6).

    Attributes:
        conditions: the watched conditions on values of push ports, by the keys of the actions that watch them.
    """

    def __init__(self) -> None:
        self._values: dict[str, tuple[Any, ...]] = {}
        self._tests: defaultdict[str, list[Test]] = defaultdict(list)
        self._calls = LoopCalls()
        self.conditions: dict[str, ValueCondition] = {}

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling, without activations, which stay in this process."""
        return {"_values": self._values, "_tests": defaultdict(list), "_calls": LoopCalls(), "conditions": {}}

    def replace_values(self, key: str, values: Mapping[str, Any]) -> None:
        """Replace values of a watched condition's variables; raise `InputError` if it is not watched."""
        if key not in self.conditions:
            raise InputError(f"no condition is watched for {key}")
        self.conditions[key].replace_values(values)

    def active(self, event: str) -> bool:
        """Return whether the event has an activation."""
        return bool(self._tests[event])

    def update(self, event: str, values: tuple[Any, ...]) -> None:
        """Store the event's values, and call all its tests with them, in the thread of their loop."""
        self._calls.call(self._update, event, values)

    def _update(self, event: str, values: tuple[Any, ...]) -> None:
        self._values[event] = values
        for test in tuple(self._tests[event]):
            test(*values)

    @contextmanager
    def tested(self, event: str, test: Test) -> Iterator[None]:
        """Call the test with the event's present values, if any, and inside the block with each update."""
        self._calls.bind()
        self._tests[event].append(test)
        try:
            if event in self._values:
                test(*self._values[event])
            yield
        finally:
            self._tests[event].remove(test)


async def _ask(_: Any, body: SkillBody, __: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
    answer = await body(**arguments)
    return Outcome(ANSWERED, answer.attributes, answer.observed)


async def _activate(component: Any, body: SkillBody, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
    """Test each new value until the action is cancelled or the test raises an error."""
    held = False
    failed: asyncio.Future[Outcome] = asyncio.get_running_loop().create_future()

    def test(*values: Any) -> None:
        nonlocal held
        try:
            with contained():
                found = body(*values, **arguments)
            if found is not None and not held:
                call.report(found)
            held = found is not None
        except Exception as error:  # noqa: BLE001  # the error fails this activation, not the caller of `update`
            if not failed.done():
                failed.set_exception(error)

    activations: EventActivations = component.activations
    with activations.tested(body.__name__, test):
        return await failed


def plain_methods(kind: type[object]) -> frozenset[str]:
    """Return the public methods of a component class that have no decorator of this package."""
    bodies = inspect.getmembers(kind, inspect.isfunction)
    decorated = {DECLARED, TAKES}
    return frozenset(name for name, body in bodies if name[0] != "_" and decorated.isdisjoint(vars(body)))
