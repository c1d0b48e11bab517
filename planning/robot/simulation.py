"""Simulated worlds: the devices of a robot in a simulation, with faults and the true state."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, cast

from dsc.chance import choose, uniform
from dsc.components.assembly import require_instances
from dsc.components.component import Component
from dsc.components.hooks import contained
from dsc.errors import ProgrammingError
from dsc.text.profiles import Profile
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.tracebacks import place_of
from knowledge_base.user_objects import shown

if TYPE_CHECKING:
    from pydantic import BaseModel

    from dsc.sequencer.run_end import RunEnd
    from dsc.trace import Record, Trace
    from knowledge_base.store import KnowledgeBase


@dataclass(frozen=True, slots=True)
class Setup:
    """The options of a run that a simulation reads.

    Attributes:
        seed: the seed of the faults; `None` if the caller sets none.
        faults: the chance of a fault per skill call, in [0, 1]; `None` if the caller sets none.
        scenario: the initial world: a file, or a value that the simulation reads, see `Simulation.reads_scenarios`.
        profile: the settings profile of the robot.
        store: the store that keeps the run, see `Simulation.lasts`.
        resumes: whether the run in the store is resumed.
    """

    seed: int | None = None
    faults: float | None = None
    scenario: object = None
    profile: Profile | None = None
    store: Path | None = None
    resumes: bool = False


@dataclass(frozen=True, slots=True)
class Left:
    """A part of the goal that is not reached.

    Attributes:
        what: an object, or a condition that is false.
        where: the place of the object; empty if unknown.
        reason: the reason why this part is not reached; empty if unknown.
    """

    what: str
    where: str = ""
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault that happened in a simulation: its kind, and the id of the action that it hit."""

    kind: str
    action: str


class Simulation(ABC):
    """A simulated world of one run. Subclass it, and name the subclass in `Bundle.simulation`.

    Args:
        setup: the options of the run.

    Attributes:
        setup: the options of the run.
        seed: the seed of the faults.
        chance: the chance of a fault per skill call, in [0, 1].
        fired: the faults that happened, in order.
        reads_scenarios: whether `setup.scenario` may name a file.
        scenario_form: the class of scenarios, a pydantic model, whose keys editors complete; `None` without one.
        lasts: whether the world survives a crash of the robot program. Such a world keeps its state and the ids of
            executed actions next to `setup.store`, and loads both if `setup.resumes`. Without `lasts`, a kept run can
            be inspected, but not resumed.

    Raises:
        InputError: the chance is outside [0, 1].
    """

    reads_scenarios: ClassVar[bool] = False
    scenario_form: ClassVar[type[BaseModel] | None] = None
    lasts: ClassVar[bool] = False

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.seed = setup.seed or 0
        self.chance = setup.faults or 0.0
        self.fired: list[Fault] = []
        if not 0.0 <= self.chance <= 1.0:
            message = f"the chance of a fault is between 0 and 1, not {self.chance:g}"
            raise InputError(message, found=str(self.chance))

    @abstractmethod
    def components(self) -> Iterable[Component]:
        """Return the components that act on this world."""

    def begin(self) -> None:  # noqa: B027  # most simulations have nothing to write
        """Write the file of a world that lasts; called once, after the store of a new run was opened."""

    def knowledge(self) -> Delta:
        """Return the knowledge of the robot at the start of the run; by default none."""
        return Delta()

    def left(self) -> Sequence[Left] | None:
        """Return the parts of the goal that are left in the true state; `None` if the world checks no goal."""
        return None

    def reason(self, left: Left, knowledge: KnowledgeBase, end: RunEnd) -> str:
        """Return the reason for a part of the goal that is left; empty if the end of the run is the reason."""
        del knowledge, end
        return left.reason

    def scene(self) -> list[dict[str, Any]] | None:
        """Return the drawn things, each with `id`, `shape`, `x`, `y` and `label`; `None` without a drawing."""
        return None

    def own_report(self, knowledge: KnowledgeBase, end: RunEnd) -> Mapping[str, Any]:
        """Return the robot's own fields of the report as plain data; by default none."""
        del knowledge, end
        return {}

    def headline(self, own: Mapping[str, Any], *, reached: bool) -> str | None:
        """Return the first line of the printed report for the fields of `own_report`; `None` for the common line."""
        del own, reached
        return None

    def fault(self, action: str, *kinds: str) -> str | None:
        """Return the kind of the fault that hits an action, and record the fault; `None` without a fault.

        The result depends only on the seed, the chance, the action and the kinds. A resumed run therefore meets the
        same faults.

        Args:
            action: the id of the action, `SkillCall.action_id`.
            kinds: the faults that can hit the action.
        """
        if not kinds or uniform(self.seed, action, " ".join(("fault", *kinds))) >= self.chance:
            return None
        fault = Fault(choose(self.seed, action, "kind", kinds), action)
        if fault not in self.fired:
            self.fired.append(fault)
        return fault.kind

    def close(self) -> None:  # noqa: B027  # most simulations have nothing to close
        """Close files and devices of the world; called once, after the run."""


def knowledge_of(world: Simulation) -> Delta:
    """Return the initial knowledge; raise `ProgrammingError` if the user's method returns something else."""
    found: object = world.knowledge()
    _require_result(type(world).knowledge, found, Delta, "a Delta")
    return cast("Delta", found)


def components_in(world: Simulation) -> list[Component]:
    """Return the components of a world.

    Raises:
        ProgrammingError: the user's method returns something else than a list.
        InputError: a part of the list is not a component.
    """
    found: object = world.components()
    _require_result(type(world).components, found, Iterable, "a list")
    listed = [*cast("Iterable[Component]", found)]
    try:
        if not all(isinstance(one, Component) for one in listed):
            require_instances(listed)
    except InputError as error:
        error.place = error.place or place_of(type(world).components)
        raise
    return listed


def left_in(world: Simulation) -> list[Left] | None:
    """Return the parts that are left; raise `ProgrammingError` if the user's method returns something else."""
    found: object = world.left()
    if found is None and type(world).left is Simulation.left:
        return None
    _require_result(type(world).left, found, Iterable, "a list")
    left = [*cast("Iterable[object]", found)]
    for one in left:
        _require_result(type(world).left, one, Left, "a Left in its list")
    return cast("list[Left]", left)


def _require_result(method: Callable[..., object], found: object, wanted: type, words: str) -> None:
    if not isinstance(found, wanted) or isinstance(found, str):
        said = f"{method.__qualname__}: it returns {shown(found)[:60]} instead of {words}"
        raise ProgrammingError(f"{said} ({place_of(method)})")


def scene_of(world: Simulation) -> list[dict[str, Any]] | None:
    """Return the scene; raise `ProgrammingError` if the user's method raises an exception."""
    with contained(f"{type(world).__name__}.scene"):
        return world.scene()


class SceneWriter:
    """A trace listener that writes a record `scene` after each event that changed the scene."""

    def __init__(self, world: Simulation, trace: Trace) -> None:
        self._world = world
        self._trace = trace
        self._drawn: list[dict[str, Any]] | None = None

    def __call__(self, record: Record) -> None:
        """Write the scene after a record that may have changed it."""
        if record.type not in {"plot", "event", "knowledge"}:
            return
        scene = scene_of(self._world)
        if scene is not None and scene != self._drawn:
            self._drawn = scene
            self._trace.record("scene", things=scene)
