"""The scenario: a YAML file with the items on the table at the start.

The file lists items by their number; their names are then cup1, cup2, …, can1, …, crisp_can1, …:

    table: {cups: 4, cans: 3, crisp_cans: [small, large]}

The file may also list items by name, with or without numbered items:

    table:
      items:
        red_cup: cup
        pringles: {kind: crisp_can, size: large}
        coke: {kind: can, behind: pringles}      # pringles hides coke while both are on the table
    seed: 7             # optional: seed of the faults; the command line overrides it
    faults: 0.2         # optional: chance of a fault per skill call
    robot_at: operator  # optional: table, shelf, floor, sink, bin or operator

Kinds are `cup`, `can` and `crisp_can`. A crisp can has the size `small` (the default, room for one can) or `large`
(room for two cans). A name must be a PDDL name in lower case. A file must list at most 200 items.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import ConfigDict, Field, model_validator

from domains.clean_up_table.items import (
    CAN,
    CRISP_CAN,
    CUP,
    OPERATOR,
    PLACES,
    SIZES,
    Inventory,
    Item,
    check_behind,
    check_name,
    new_item,
)
from domains.clean_up_table.table_world import TableWorld
from dsc.model.reading import Form
from dsc.text.yaml import load_document, read_file, read_model
from knowledge_base.errors import InputError, Place, UnknownNameError

if TYPE_CHECKING:
    from pathlib import Path

MAX_ITEMS = 200

_KINDS = {"cup": CUP, "can": CAN, "crisp_can": CRISP_CAN}
_DEFAULT_SIZE = "small"

PlaceOf = Callable[[tuple[str | int, ...]], Place | None]
Count = Annotated[int, Field(strict=True, ge=0, le=MAX_ITEMS)]


class _ScenarioForm(Form):
    model_config = ConfigDict(extra="forbid", frozen=True)


class NamedItem(_ScenarioForm):
    """One named item; `red_cup: cup` is short for `red_cup: {kind: cup}`."""

    kind: str
    size: str | None = None
    behind: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _short(cls, data: Any) -> Any:
        return {"kind": data} if isinstance(data, str) else data


class Table(_ScenarioForm):
    """The items that are on the table at the start."""

    cups: Count = 0
    cans: Count = 0
    crisp_cans: tuple[str, ...] = ()
    items: dict[str, NamedItem] = Field(default_factory=dict)


class Scenario(_ScenarioForm):
    """The start of a run: the items on the table, the robot's place, and the seed and chance of faults."""

    table: Table
    seed: Annotated[int, Field(strict=True)] | None = None
    faults: Annotated[float, Field(strict=True, ge=0.0, le=1.0)] | None = None
    robot_at: str = OPERATOR

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Return the scenario of a file.

        Raises:
            InputError: the file contains an error; the message contains the place, the wrong word and the nearest valid
                name.
        """
        return cls.parse(read_file(path), str(path))

    @classmethod
    def parse(cls, text: str, source: str | None = None) -> Self:
        """Return the scenario of a text; `InputError` messages identify the text by `source`."""
        document = load_document(text, source)
        scenario = read_model(cls, document)
        scenario.check(document.place)
        return scenario

    @classmethod
    def default(cls) -> Self:
        """Return the default scenario: four cups, three cans, a small and a large crisp can."""
        return cls(table=Table(cups=4, cans=3, crisp_cans=("small", "large")))

    def world(self, seed: int | None = None, faults: float | None = None) -> TableWorld:
        """Return a new world of the scenario.

        Args:
            seed: the seed of the faults; by default the seed of the scenario, or 0.
            faults: the chance of a fault per skill call, in [0, 1]; by default the chance of the scenario, or 0.

        Raises:
            InputError: the scenario was constructed in Python with an invalid name or value.
        """
        self.check()
        seed = self.seed if seed is None else seed
        faults = self.faults if faults is None else faults
        return TableWorld(self._items(), seed=seed or 0, faults=faults or 0.0, robot_at=self.robot_at)

    def check(self, place_of: PlaceOf = lambda _path: None) -> None:
        """Raise `InputError` for an invalid name or value; `place_of` returns the place of a path of keys."""
        _check_word("place", self.robot_at, PLACES, place_of(("robot_at",)))
        for position, size in enumerate(self.table.crisp_cans):
            _check_word("size", size, SIZES, place_of(("table", "crisp_cans", position)))
        for name, item in self.table.items.items():
            _check_item(name, item, place_of)
        if self._count() > MAX_ITEMS:
            raise InputError(f"{self._count()} items are more than {MAX_ITEMS}", place=place_of(("table",)))
        self._check_hiding(place_of)

    def _count(self) -> int:
        table = self.table
        return table.cups + table.cans + len(table.crisp_cans) + len(table.items)

    def _check_hiding(self, place_of: PlaceOf) -> None:
        fronts = {item.name: item.behind for item in self._items()}
        for name in self.table.items:
            path = ("table", "items", name, "behind")
            _located(place_of(path), check_behind, name, fronts)

    def _items(self) -> list[Item]:
        table = self.table
        items = Inventory()
        # A numbered item, which is added later, may hide a named item. The attribute `behind` is therefore set last.
        for name, named in table.items.items():
            items.add(new_item(_KINDS[named.kind], name, size=named.size or _DEFAULT_SIZE))
        for kind, sizes in (
            (CUP, [_DEFAULT_SIZE] * table.cups),
            (CAN, [_DEFAULT_SIZE] * table.cans),
            (CRISP_CAN, table.crisp_cans),
        ):
            for size in sizes:
                items.add(new_item(kind, items.free_name(kind), size=size))
        for name, named in table.items.items():
            items[name].behind = named.behind
        return list(items)


def _check_item(name: str, item: NamedItem, place_of: PlaceOf) -> None:
    path = ("table", "items", name)
    _located(place_of(path), check_name, name)
    _check_word("kind", item.kind, _KINDS, place_of((*path, "kind")))
    if item.size is None:
        return
    _check_word("size", item.size, SIZES, place_of((*path, "size")))
    if _KINDS[item.kind] != CRISP_CAN:
        message = f"only a crisp_can has a size; '{name}' is a {item.kind}"
        raise InputError(message, place=place_of((*path, "size")))


def _check_word(what: str, word: str, valid: Iterable[str], place: Place | None) -> None:
    if word not in valid:
        raise UnknownNameError(f"there is no {what} '{word}'", place=place, found=word, valid=valid)


def _located(place: Place | None, check: Callable[..., None], *args: Any) -> None:
    try:
        check(*args)
    except InputError as error:
        raise (error.located(place) if place else error) from None
