"""Times of a state: its upper bounds are not below its lower one (S3.1)."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.errors import Finding
from dsc.model.plot import ActionPlot
from dsc.model.states import State
from dsc.validation.nesting import Nesting
from knowledge_base.errors import SchemaError
from knowledge_base.language.expression import Constant, Term


def check_timing(plot: ActionPlot, nesting: Nesting) -> Iterator[Finding]:
    """Findings about timeouts that come while the state still has to wait."""
    for name, state, path in nesting.states:
        least = _seconds(state.at_least) if isinstance(state, State) else None
        if not isinstance(state, State) or least is None:
            continue
        for number, timed in enumerate(state.after):
            after = _seconds(timed.seconds)
            if after is not None and after < least:
                error = SchemaError(
                    f"state '{name}' lasts at least {least:g} s, so its timeout cannot be taken after {after:g} s",
                    place=plot.place((*path, "after", number, "seconds")),
                )
                yield Finding(error, "at least", f"let it be {least:g} s or more")


def _seconds(term: Term | None) -> float | None:
    """The seconds that a constant says."""
    return float(term.value) if isinstance(term, Constant) else None
