"""Demands of components on their host: hardware, resources and real-time tasks (S1.12, S1.21)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from dsc.model.language import Frozen
from dsc.model.reading import LOCATED, Form

Amount = Annotated[float, Field(ge=0)]
"""An amount of a resource, in the unit of the resource."""

SHORTEST = 1e-6
"""Minimum period of a task, in seconds."""


class TimedTask(Frozen):
    """A real-time task of a component; all times are seconds.

    Attributes:
        period: the minimum time between two arrivals.
        worst_case: the longest execution time, at most the period and the deadline.
        deadline: the time until each execution must have ended; without it, the period.
        jitter: the longest delay from an arrival until the task is ready.
        blocking: the longest time for which less urgent tasks block the task, e.g. by locks.
        priority: a greater number is more urgent. Without it, tasks of shorter deadlines are more urgent.
        core: the processor core of the host, from 0.
    """

    period: float = Field(ge=SHORTEST)
    worst_case: float = Field(gt=0)
    deadline: float | None = Field(default=None, gt=0)
    jitter: float = Field(default=0.0, ge=0)
    blocking: float = Field(default=0.0, ge=0)
    priority: int | None = None
    core: int = Field(default=0, ge=0)

    @property
    def due(self) -> float:
        """The deadline, which is the period if none is given."""
        return self.period if self.deadline is None else self.deadline

    @model_validator(mode="after")
    def _check_times(self) -> Self:
        for name, limit in (("period", self.period), ("deadline", self.due)):
            if self.worst_case > limit:
                message = f"the worst case of {self.worst_case:g} s is longer than the {name} of {limit:g} s"
                raise PydanticCustomError(LOCATED, "{problem}", {"problem": message, "path": ("worst_case",)})
        return self


class Demand(Frozen):
    """Needs of a component at its host, always or in one of its modes.

    Attributes:
        hardware: devices, each by its kind or its name.
        resources: amounts of resources by name, e.g. `{"memory": 200}`; the deployment states the units.
        tasks: real-time tasks by name.
    """

    hardware: tuple[str, ...] = ()
    resources: dict[str, Amount] = Field(default_factory=dict)
    tasks: dict[str, TimedTask] = Field(default_factory=dict)


class _Demands(Form):
    demands: dict[str, Demand]


def read_demands(data: Mapping[str, Any]) -> dict[str, Demand]:
    """Return the demands of a class by mode; each is a `Demand` or a mapping of its attributes.

    Raises:
        InputError: the data are not demands; the message has the path in the data and the nearest valid key.
    """
    return _Demands.model_validate({"demands": data}).demands
