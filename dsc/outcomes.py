"""Outcomes of skills: typed classes whose attributes are the data of the outcome event (S0.7, S2.11).

```python
Item = NewType("Item", str)  # objects of the type `item`


class Grasped(Outcome):  # the event `grasped`
    item: Item


class Slipped(Outcome): ...
```

A type checker verifies each construction, e.g. `Grasped(item=item, observed=seen)`. The classes that a skill's
annotations name are the declaration of its outcomes; no second list exists.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from inspect import get_annotations
from types import MappingProxyType
from typing import Any, ClassVar, Never, NoReturn, dataclass_transform

from dsc.annotations import (
    FoundRecords,
    Namespace,
    add_records,
    class_statement,
    evaluated,
    is_class_variable,
    lower_name,
    members,
    type_of,
)
from dsc.data_types import WORDS
from dsc.python_values import plain_value
from knowledge_base.errors import SchemaError, UnknownNameError
from knowledge_base.facts import Delta
from knowledge_base.spelling import is_plain_name

_UNCHANGED = Delta()
_NONE: Mapping[str, Any] = MappingProxyType({})


@dataclass_transform(kw_only_default=True, frozen_default=True)
class _Typed:
    """Base class from which type checkers derive the constructors of subclasses; its own attributes do not count."""

    event: str
    attributes: Mapping[str, Any]


class Outcome(_Typed):
    """The end of a skill: its outcome event, the event's attributes, and its observations.

    Before the event is handled, `observed` is applied to the knowledge base, with the component as author. As in an
    effect of a planning action, a fact that is both removed and added is true.

    A subclass declares one outcome: its annotations are the attributes, and `event` is by default the name of the class
    in lower case with underscores. `class Lost(Outcome, event="gave_way")` gives another name. `Outcome` itself
    represents any outcome, e.g. in tests and in transports: `Outcome("grasped", {"item": "cup"})`.
    """

    observed: Delta = _UNCHANGED
    declared: ClassVar[dict[str, str | None]] = {}
    """Types of the attributes by name; `None` accepts any value."""
    records: ClassVar[FoundRecords] = {}
    """The records in the types of the attributes."""
    declared_by: ClassVar[str] = ""
    """The skill that declares this outcome, for messages; empty without one."""
    _defaults: ClassVar[dict[str, Any]] = {}

    def __init__(self, event: str, attributes: Mapping[str, Any] = _NONE, observed: Delta = _UNCHANGED) -> None:
        vars(self).update(event=event, attributes=attributes, observed=observed)

    def __init_subclass__(cls, event: str | None = None) -> None:
        """Declare an outcome.

        Raises:
            SchemaError: an attribute has the name of an attribute of every outcome, or its annotation is not valid.
                The class is a subclass of an outcome that a skill declares: the skill could return it undeclared.
        """
        own = {name: one for name, one in get_annotations(cls).items() if not is_class_variable(one)}
        cls.declared, cls._defaults, cls.records = (dict(cls.declared), dict(cls._defaults), dict(cls.records))
        cls.event = event or lower_name(cls.__name__)
        cls.__init__ = _fill  # type: ignore[method-assign]
        with class_statement(cls) as names:
            for above in cls.__mro__[1:]:
                if declared_by := vars(above).get("declared_by"):
                    raise _subclass_error(cls, above, declared_by)
            cls.declared.update(_types(cls.__qualname__, own, names, cls.records))
        cls._defaults.update({name: vars(cls)[name] for name in own if name in vars(cls)})

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"an outcome is immutable: '{name}' cannot be set")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Outcome):
            return NotImplemented
        return (self.event, self.attributes, self.observed) == (other.event, other.attributes, other.observed)

    __hash__ = None  # type: ignore[assignment]  # the attributes are a mapping

    def __repr__(self) -> str:
        given = [f"{name}={value!r}" for name, value in self.attributes.items()]
        given += [f"observed={self.observed!r}"] if self.observed else []
        if type(self) is Outcome:
            return f"Outcome({', '.join([repr(self.event), *given])})"
        return f"{type(self).__name__}({', '.join(given)})"


_PLAIN = frozenset({"number", "integer", "boolean", *WORDS})
"""Types whose values are plain data in Python, too."""
_TAKEN = frozenset({"event", "attributes", "observed", "declared", "records", "declared_by"})


def _fill(self: Outcome, *given: object, observed: Delta = _UNCHANGED, **values: Any) -> None:
    """Set the attributes of a declared outcome; `__init__` of all subclasses."""
    kind = type(self)
    if given:
        raise _values_without_names(kind)
    attributes = {**kind._defaults, **values}  # noqa: SLF001  # a method of the class
    if attributes.keys() != kind.declared.keys():
        _refuse(kind, attributes)
    plain = attributes
    if not _PLAIN.issuperset(kind.declared.values()):
        plain = {name: plain_value(value) for name, value in attributes.items()}
    vars(self).update(attributes, attributes=plain, observed=observed)


def _values_without_names(kind: type[Outcome]) -> SchemaError:
    """Return the error about values without the names of their attributes."""
    named = ", ".join(f"{name}=…" for name in (*kind.declared, "observed"))
    return SchemaError(f"the attributes of an outcome have names: {kind.__name__}({named})")


def _refuse(kind: type[Outcome], given: Mapping[str, Any]) -> None:
    """Raise an error for an attribute that is missing or not declared."""
    for name in given.keys() - kind.declared.keys():
        message = f"outcome {kind.__name__} has no attribute '{name}'"
        raise UnknownNameError(message, found=name, valid=(*kind.declared, "observed"))
    missing = ", ".join(f"'{name}'" for name in kind.declared if name not in given)
    raise SchemaError(f"outcome {kind.__name__} needs its attribute {missing}")


def declared_outcomes(
    annotation: object, names: Namespace, what: str, records: FoundRecords, *, optional: bool = False
) -> dict[str, dict[str, str | None]]:
    """Return the outcomes that an annotation names: attributes with types, by event.

    Args:
        annotation: the annotation, which may be text.
        names: the names that the annotation may use.
        what: the annotated value, for messages.
        records: receives the records in the types of attributes.
        optional: whether the value may be `None`.

    Raises:
        SchemaError: the annotation names something else than outcome classes, or two classes of one event. It names a
            class without its subclass, which a type checker accepts as a returned value, too.
    """
    found: dict[str, dict[str, str | None]] = {}
    named = list[type[Outcome]]()
    for kind in members(evaluated(annotation, names, what)):
        if kind in {Never, NoReturn} or (optional and kind in {None, type(None)}):
            continue
        if kind in {None, type(None)}:
            raise SchemaError(f"{what} may be None, which is not an outcome; a skill that never ends has `-> Never`")
        if kind is Outcome:
            raise SchemaError(f"{what} is any Outcome; name its classes, as in `-> Grasped | Slipped`")
        if not (isinstance(kind, type) and issubclass(kind, Outcome)):
            shown = getattr(kind, "__name__", repr(kind))
            raise SchemaError(f"{what} names {shown}, which is not a subclass of Outcome", found=shown)
        if kind.event in found:
            raise SchemaError(f"{what} names two classes for the event '{kind.event}'", found=kind.event)
        found[kind.event] = dict(kind.declared)
        add_records(records, kind.records)
        named.append(kind)
    for kind in named:
        for below in kind.__subclasses__():
            if below not in named:
                raise _subclass_error(below, kind, what)
        kind.declared_by = what
    return found


def _subclass_error(below: type, kind: type, what: str) -> SchemaError:
    message = f"{below.__qualname__} is a subclass of {kind.__qualname__}, the outcome of {what}"
    return SchemaError(
        f"{message}, which could return it undeclared; give both a common base class", found=below.__name__
    )


def _types(
    outcome: str, annotations: Mapping[str, object], names: Namespace, records: FoundRecords
) -> Iterator[tuple[str, str | None]]:
    for name, annotation in annotations.items():
        if not is_plain_name(name):
            message = f"attribute '{name}' of outcome {outcome} cannot be read in plots, which have lower-case names"
            raise SchemaError(f"{message}; write '{lower_name(name)}'", found=name)
        if name in _TAKEN:
            message = f"outcome {outcome} cannot have the attribute '{name}', which every outcome has"
            raise SchemaError(message, found=name)
        yield (name, type_of(evaluated(annotation, names, f"'{name}' of outcome {outcome}"), records))
