"""Monitoring profiles: the entries of components to observe, and how often (S1.19)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from dsc.model.language import Frozen, Written
from dsc.text.yaml import load_document, read_file, read_model
from knowledge_base.origin import origin_of

CHANGE = "change"


def _check_time(value: str | float) -> str | float:
    if value == CHANGE or (isinstance(value, float) and value > 0):
        return value
    raise ValueError(f"the time is `change`, or a positive number of seconds; found {value!r}")


When = Annotated[str | float, AfterValidator(_check_time)]
"""The time of an observation: at each change, or every number of seconds."""


class Observed(Frozen):
    """The observed entries of one component.

    Attributes:
        diagnose: times by entry of the component's diagnosis, e.g. `life`, `steps.late` or `parameters.speed`.
        streams: times by push port.
    """

    diagnose: dict[str, When] = Field(default_factory=dict)
    streams: dict[str, When] = Field(default_factory=dict)


class MonitoringProfile(Written):
    """A monitoring profile.

    Attributes:
        name: name of the profile (`monitor`).
        sample: seconds between two diagnoses of a component, which find changes.
        components: the observed entries by component.
    """

    name: str = Field(alias="monitor", pattern=r"^[a-zA-Z_][\w\-]*$")
    about: str | None = None
    sample: float = Field(default=1.0, gt=0)
    components: dict[str, Observed] = Field(min_length=1)


def parse_monitoring(text: str, source: str | None = None) -> MonitoringProfile:
    """Return the monitoring profile that YAML text contains; `source` is the file name in messages.

    Raises:
        InputError: the text is not a monitoring profile; the message has the place and the nearest valid key.
    """
    document = load_document(text, origin_of(text, source))
    return read_model(MonitoringProfile, document).written_at(document.places)


def load_monitoring(path: Path | str) -> MonitoringProfile:
    """Return the monitoring profile in a file; errors as for `parse_monitoring` and `read_file`."""
    return parse_monitoring(read_file(path), str(path))
