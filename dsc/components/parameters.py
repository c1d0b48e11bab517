"""Parameters of components as typed classes (S1.11, S2.11).

A builder declares the range of each parameter, an integrator sets values, and others change them.

```python
class BaseParameters(Parameters):
    speed: float = parameter(0.5, least=0.1, most=1.5)  # metres per second
    navigation: Literal["planned", "reactive"] = "planned"
    port: str = parameter(changed_by="profile")  # a profile must set it


class Base(Component):
    parameters: BaseParameters
```

A type checker verifies each use, e.g. `self.parameters.speed`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from inspect import get_annotations
from typing import Any, ClassVar, Literal, TypeVar, dataclass_transform, get_args, get_origin, overload

from dsc.annotations import Namespace, class_statement, evaluated, is_class_variable, type_of
from dsc.components.declarations import Parameter, Type, changed, check_declarations, known, missing, violated
from dsc.model.ranges import Who, refuse_change
from knowledge_base.errors import SchemaError, tolerated
from knowledge_base.facts import Value

_T = TypeVar("_T", bound=Value)


@overload
def parameter(
    default: _T,
    *,
    least: float | None = ...,
    most: float | None = ...,
    changed_by: Who = ...,
    depends_on: tuple[str, ...] = ...,
) -> _T: ...
@overload
def parameter(
    *,
    least: float | None = ...,
    most: float | None = ...,
    changed_by: Who = ...,
    follows: str | None = ...,
    depends_on: tuple[str, ...] = ...,
) -> Any: ...
def parameter(default: Value | None = None, **declared: Any) -> Any:
    """Declare the default, range and roles of a parameter in a subclass of `Parameters`; the annotation is the type.

    Args:
        default: the value until another value is set; without a default, a profile must set the value.
        declared: see `Parameter`: `least`, `most`, `changed_by`, `follows` and `depends_on`.
    """
    return partial(Parameter, default=default, **declared)


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(parameter,))
class Parameters(Mapping[str, Any]):
    """The present values of one component's parameters, as attributes and by name; only the component sets them.

    The annotations of a subclass declare the parameters: `float` and `int`, `bool`, `str`, or a `Literal` of the
    permitted values. The value in the class is the default, or a `parameter(...)`. A component without a subclass has
    any parameters, e.g. `self.parameters["speed"]`.

    Attributes:
        relations: conditions between the parameters that must always be true, e.g. `(<= ?speed (* 0.5 ?cycle))`.
        declared: the declarations, by name.
    """

    relations: ClassVar[tuple[str, ...]] = ()
    declared: ClassVar[Mapping[str, Parameter]] = {}

    def __init__(self, component: str, values: Mapping[str, Any]) -> None:
        vars(self).update(_component=component, _values=values)

    def __init_subclass__(cls) -> None:
        """Declare the parameters of a component.

        Raises:
            InputError: an annotation, range, default or relation is not valid; the message has the line of the class.
        """
        with class_statement(cls) as names:
            cls.declared = {**cls.declared, **dict(_list_declared(cls, names))}
            check_declarations(cls.__qualname__, cls.declared, cls.relations)

    def __getitem__(self, name: str) -> Any:
        return vars(self)["_values"][name]

    def __iter__(self) -> Iterator[str]:
        return iter(vars(self)["_values"])

    def __len__(self) -> int:
        return len(vars(self)["_values"])

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"'{name}' cannot be set here; use `await self.configure({name!r}, …)` of the component")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self.items())})"


def parameters_of(declared: Mapping[str, Parameter], relations: tuple[str, ...]) -> type[Parameters]:
    """Return a class of parameters for declarations of another program; raise `InputError` if they are not valid."""
    check_declarations("Parameters", declared, relations)

    class DeclaredParameters(Parameters):
        pass

    DeclaredParameters.declared, DeclaredParameters.relations = declared, relations
    for name in declared:
        setattr(DeclaredParameters, name, property(partial(_value, name)))
    return DeclaredParameters


def _list_declared(kind: type[Parameters], names: Namespace) -> Iterator[tuple[str, Parameter]]:
    """Yield the parameters that the annotations of a class declare, and give the class an attribute for each."""
    annotations = get_annotations(kind)
    for name, value in vars(kind).items():
        if name not in annotations and isinstance(value, partial | str | int | float) and name not in _TAKEN:
            message = f"'{name}' of {kind.__qualname__} has no annotation, which is the type: {name}: float = …"
            raise SchemaError(message, found=name)
    for name, annotation in annotations.items():
        if is_class_variable(annotation):
            continue
        said = f"parameter '{name}' of {kind.__qualname__}"
        if name in _TAKEN:
            raise SchemaError(f"{said} hides an attribute of every `Parameters`; choose another name", found=name)
        given = vars(kind).get(name)
        made = given if isinstance(given, partial) else partial(Parameter, default=given)
        yield name, made(**_read_type(evaluated(annotation, names, said), said))
        setattr(kind, name, property(partial(_value, name)))


def _read_type(annotation: object, said: str) -> dict[str, Any]:
    """Return the type, and the permitted values, that an annotation declares."""
    among = get_args(annotation) if get_origin(annotation) is Literal else ()
    first = type(among[0]) if among and len({*map(type, among)}) == 1 else annotation
    kind = {"integer": "number"}.get(found, found) if (found := type_of(first)) else None
    if kind not in get_args(Type):
        shown = getattr(annotation, "__name__", None) or str(annotation)
        valid = "float, int, bool, str or a Literal of one type"
        raise SchemaError(f"the annotation of {said} is {shown}, which is none of {valid}", found=shown)
    whole = annotation is int or (bool(among) and all(isinstance(one, int) for one in among))
    return {"type": kind, "among": among, "whole": whole and kind == "number"}


def _value(name: str, parameters: Parameters) -> Value:
    values = vars(parameters)["_values"]
    if name not in values:
        raise missing(vars(parameters)["_component"], name, parameters.declared)
    return values[name]  # type: ignore[no-any-return]  # values are checked when they are set


_TAKEN = frozenset({*dir(Parameters)})


class ParameterValues:
    """The values of one component's parameters, and the operations that set them.

    Args:
        component: the component's name, for messages.
        kind: the class of the parameters; `Parameters` itself permits any name.

    Attributes:
        declared: the declarations by name.
        relations: conditions between the parameters.
    """

    def __init__(self, component: str, kind: type[Parameters]) -> None:
        self.component = component
        self.declared = kind.declared
        self.relations = kind.relations
        self._as_one_set = False
        self._values: dict[str, Any] = {}
        with tolerated():
            self._values |= changed(component, self.declared, {}, dict.fromkeys(self.declared))
        self.parameters = kind(component, self._values)

    def set(self, name: str, value: Any) -> None:
        """Set a parameter; `None` resets a declared one.

        Raises:
            UnknownNameError: the component declares parameters, and `name` is not among them.
            InputError: the value violates its declaration or a relation.
        """
        after = self._after(self._values, {name: value})
        if not self._as_one_set:
            self._check_relations(after)
        self.replace(after)

    @contextmanager
    def as_one_set(self, values: Mapping[str, Any]) -> Iterator[None]:
        """Validate values as one set; inside the block, `set` checks no relations.

        Raises:
            UnknownNameError: the component declares parameters, and a name is not among them.
            InputError: a value violates its declaration or a relation.
        """
        after: Mapping[str, Any] = self._values
        for name, value in values.items():
            after = self._after(after, {name: value})
        self._check_relations(after)
        self._as_one_set = True
        try:
            yield
        finally:
            self._as_one_set = False

    def check(self, name: str, value: Any, who: Who) -> None:
        """Validate a value of a declared parameter without setting it.

        Raises:
            UnknownNameError: the component declares no such parameter.
            InputError: the role `who` may not change the parameter, or the value violates its declaration or a
                relation.
        """
        refuse_change(f"{self.component}.{name}", who, known(self.component, name, self.declared).changed_by)
        self._check_relations(self._after(self._values, {name: value}))

    def after(self, settings: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values after the settings of a profile.

        Raises:
            SchemaError: a parameter has no value, a setting violates its declaration, or a relation is false.
        """
        found = self._after(self._values, settings)
        self._require_bound(found)
        self._check_relations(found)
        return found

    def replace(self, values: Mapping[str, Any]) -> None:
        """Replace all values without validation."""
        found = dict(values)
        self._values.clear()
        self._values.update(found)

    def require_bound(self) -> None:
        """Raise `NoValueError` if a declared parameter has no value; the message has the reason."""
        self._require_bound(self._values)

    def _require_bound(self, values: Mapping[str, Any]) -> None:
        for name in self.declared:
            if name not in values:
                raise missing(self.component, name, self.declared)

    def _after(self, values: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
        if not self.declared:
            return {**values, **settings}
        for name in settings:
            known(self.component, name, self.declared)
        return changed(self.component, self.declared, values, settings)

    def _check_relations(self, values: Mapping[str, Any]) -> None:
        for text in self.relations:
            if reason := violated(text, values):
                raise SchemaError(f"component '{self.component}' needs {text}, but {reason}")
