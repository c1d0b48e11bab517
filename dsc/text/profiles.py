"""Settings profiles: values of parameters for one robot or simulation, for common plots (S2.10, S1.11, S3.3)."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from dsc.model.language import Setting, Written
from dsc.model.plot import ActionPlot
from dsc.model.reading import FormPath
from dsc.model.states import Choice, DynamicState
from dsc.text.yaml import dump, load_document, read_file, read_model
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.origin import origin_of

Settings = dict[str, dict[str, Setting]]
BY_PLOT = ("plots", "choose", "devices")
"""The groups of a profile whose keys are names of plots."""


class Profile(Written):
    """A settings profile: a robot, and values of parameters for this robot.

    Attributes:
        name: name of the profile (`profile`).
        robot: name of a robot in the world; without it, the world's default robot.
        components: values by component and parameter, within the range that the component's builder declares.
        plots: new defaults by plot and parameter; plots that use the plot may pass another value.
        choose: choices of dynamic states among candidates that fit, by plot and state, see `DynamicState`.
        devices: the robot's devices by plot, and by sensor or motor of its robot section, see `dsc.cycles`; a sensor or
            motor without an entry is the device of the same name.
        wiring: providers of required ports, both as `component.port`, see `dsc.components.wiring`.
    """

    name: str = Field(alias="profile", pattern=r"^[a-zA-Z_][\w\-]*$")
    about: str | None = None
    robot: str | None = None
    components: Settings = Field(default_factory=dict)
    plots: Settings = Field(default_factory=dict)
    choose: dict[str, dict[str, Choice]] = Field(default_factory=dict)
    devices: dict[str, dict[str, Annotated[str, Field(min_length=1)]]] = Field(default_factory=dict)
    wiring: dict[str, str] = Field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Hash of the content as 12 hexadecimal digits."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()[:12]


def parse_profile(text: str, source: str | None = None) -> Profile:
    """Return the profile that YAML text contains; `source` is the file name in messages.

    Raises:
        InputError: the text is not a profile; the message has the place and the nearest valid key.
    """
    document = load_document(text, origin_of(text, source))
    if isinstance(document.data, Mapping) and "plot" in document.data and "profile" not in document.data:
        raise InputError("this is a plot, not a profile", place=document.place(("plot",)))
    return read_model(Profile, document).written_at(document.places)


def load_profile(path: Path | str) -> Profile:
    """Return the profile in a profile file; errors as for `parse_profile` and `read_file`."""
    return parse_profile(read_file(path), str(path))


def profile_to_yaml(profile: Profile) -> str:
    """Return the profile as YAML; `parse_profile` returns an equal profile."""
    return dump(profile.model_dump(mode="json", by_alias=True, exclude_defaults=True))


def find_profile(name: str, folder: Path) -> Profile:
    """Return the profile `name` of a folder; if the folder has none, `name` is the path of a profile file.

    Raises:
        InputError: neither file exists, or the file is not a profile; the message has the nearest name.
    """
    known = {file.stem: file for file in sorted(folder.glob("*.yaml"))}
    if name in known:
        return load_profile(known[name])
    if Path(name).suffix in {".yaml", ".yml"}:
        return load_profile(name)
    raise InputError(f"there is no profile '{name}', nor a file (*.yaml) of that name", found=name, valid=known)


def adapted(plots: Iterable[ActionPlot], profile: Profile | None = None) -> tuple[ActionPlot, ...]:
    """Return the plots with the profile's values as defaults of their parameters, and with its choices.

    Raises:
        UnknownNameError: a plot, parameter, dynamic state, sensor or motor of the profile does not exist.
        InputError: a value has another type than the parameter or is out of its range, or a profile may not change it;
            or two sensors or two motors are the same device.
    """
    plots = tuple(plots)
    if profile is None or not any(getattr(profile, group) for group in BY_PLOT):
        return plots
    names = [plot.name for plot in plots]
    for group in BY_PLOT:
        for name in getattr(profile, group):
            if name not in names:
                raise unknown_in(profile, group, "plot", name, names)
    return tuple(with_profile(plot, profile) for plot in plots)


def with_profile(plot: ActionPlot, profile: Profile) -> ActionPlot:
    """Return one plot with the profile's values as defaults, and with its choices; errors as for `adapted`."""
    for name, value in profile.plots.get(plot.name, {}).items():
        with _at(profile, ("plots", plot.name, name)):
            plot = plot.with_default(name, value, "profile")
    for state, choice in profile.choose.get(plot.name, {}).items():
        with _at(profile, ("choose", plot.name, state)):
            plot = _with_choice(plot, state, choice)
    devices_of(plot, profile)
    return plot


def devices_of(plot: ActionPlot, profile: Profile) -> dict[str, str]:
    """Return the robot's devices by sensor and motor of a plot; errors as for `adapted`."""
    groups = () if plot.robot is None else (plot.robot.sensors, plot.robot.motors)
    given = profile.devices.get(plot.name, {})
    found = {name: given.get(name, name) for group in groups for name in group}
    for name in [one for one in given if one not in found]:
        with _at(profile, ("devices", plot.name, name)):
            raise UnknownNameError(f"plot '{plot.name}' has no sensor or motor '{name}'", found=name, valid=found)
    for group in groups:
        _require_distinct({name: found[name] for name in group}, profile, plot)
    return found


def _require_distinct(devices: Mapping[str, str], profile: Profile, plot: ActionPlot) -> None:
    """Raise an error if two sensors, or two motors, of a plot are the same device."""
    names: dict[str, str] = {}
    for name, device in sorted(devices.items(), key=lambda one: one[0] in profile.devices.get(plot.name, {})):
        if device in names:
            with _at(profile, ("devices", plot.name, name)):
                remedy = "give them separate devices"
                raise InputError(
                    f"'{names[device]}' and '{name}' are both the device '{device}': {remedy}", found=device
                )
        names[device] = name


def _with_choice(plot: ActionPlot, state: str, choice: Choice) -> ActionPlot:
    """Return a copy of the plot in which a dynamic state chooses among its candidates by another rule."""
    paths = {name: path for name, one, path in plot.walk() if isinstance(one, DynamicState)}
    if state not in paths:
        raise UnknownNameError(f"plot '{plot.name}' has no dynamic state '{state}'", found=state, valid=paths)
    copied: ActionPlot = _with(plot, paths[state], {"choose": choice})
    return copied


def _with(part: Any, path: FormPath, update: Mapping[str, Any]) -> Any:
    """Return a copy of a model in which the part at a path has other fields."""
    if not path:
        return part.model_copy(update=update)
    key, *rest = path
    if isinstance(part, Mapping):
        return {**part, key: _with(part[key], tuple(rest), update)}
    return part.model_copy(update={str(key): _with(getattr(part, str(key)), tuple(rest), update)})


@contextmanager
def _at(profile: Profile, path: FormPath) -> Iterator[None]:
    """Give errors inside the block the place of a setting."""
    try:
        yield
    except InputError as error:
        error.place = profile.place(path)
        raise


def unknown_in(profile: Profile | None, group: str, kind: str, name: str, valid: Iterable[str]) -> UnknownNameError:
    """Return the error for a name in a group of a profile that is not among the valid ones."""
    error = UnknownNameError(f"there is no {kind} '{name}'", found=name, valid=valid)
    error.place = None if profile is None else profile.place((group, name))
    return error


def profile_schema() -> dict[str, Any]:
    """Return the JSON Schema of profile files, for editors."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "profile",
        **Profile.model_json_schema(by_alias=True),
    }
