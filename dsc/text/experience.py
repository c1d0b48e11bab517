"""Experience as YAML: the file that a learned choice reads (S0.14)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import Field, model_validator

from dsc.dynamic.experience import Experience
from dsc.model.language import Frozen, Written
from dsc.text.yaml import dump, load_document, read_file, read_model
from knowledge_base.origin import origin_of


class _Tries(Frozen):
    """Tries of a candidate in one situation, see `dsc.dynamic.experience`."""

    plot: str
    candidate: str
    situation: dict[str, bool] = Field(default_factory=dict)
    tries: int = Field(ge=1, strict=True)
    done: int = Field(ge=0, strict=True)
    seconds: float = Field(ge=0)

    @model_validator(mode="after")
    def _has_tried(self) -> _Tries:
        if self.done > self.tries:
            raise ValueError(f"{self.done} of {self.tries} tries cannot be done")
        return self


class _Experience(Written):
    """A file of experience."""

    experience: list[_Tries]


def parse_experience(text: str, source: str | None = None) -> Experience:
    """Return the experience that YAML text contains; `source` is the file name in messages.

    Raises:
        InputError: the text is not experience; the message has the place and the nearest valid key.
    """
    read = read_model(_Experience, load_document(text, origin_of(text, source)))
    return Experience.from_form({"tries": [one.model_dump() for one in read.experience], "seed": 0})


def load_experience(path: Path | str) -> Experience:
    """Return the experience in a file; errors as for `parse_experience` and `read_file`."""
    return parse_experience(read_file(path), str(path))


def experience_to_yaml(experience: Experience) -> str:
    """Return the experience as YAML; `parse_experience` returns an equal one."""
    tries: list[dict[str, Any]] = experience.to_form()["tries"]
    return dump({"experience": [{**one, "seconds": round(one["seconds"], 3)} for one in tries]})
