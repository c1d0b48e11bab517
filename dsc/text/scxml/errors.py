"""What SCXML can say and action plots cannot, and the other way round."""

from __future__ import annotations

from knowledge_base.errors import InputError, Place


class NotExpressibleError(InputError):
    """Something has no counterpart in the other form; `element` is what it is, for counting."""

    def __init__(self, element: str, why: str, *, place: Place | None = None) -> None:
        super().__init__(f"{element}: {why}", place=place, found=element)
        self.element = element
