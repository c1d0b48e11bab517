"""Changes of running plots: an equal plot changes nothing, and a kept state stays as it is (S2.8)."""

from __future__ import annotations

from typing import Any

from dsc_charts import PROPERTY
from hypothesis import given, settings
from hypothesis import strategies as st
from random_charts import Played, happenings, libraries

from dsc.engine.machine_forms import read_state
from dsc.engine.machine_state import MachineState
from dsc.engine.steps import Step
from dsc.errors import RunawayError
from knowledge_base.errors import InputError


def pinned(state: MachineState) -> dict[str, Any]:
    """Return the state without the marks of plots that a change has left running."""

    def plain(form):
        return {**form, "form": None, "children": {host: plain(child) for host, child in form["children"].items()}}

    form = state.to_json()
    return {**form, "root": form["root"] and plain(form["root"])}


@settings(PROPERTY, max_examples=50)
@given(libraries(depth=2), happenings(), st.sampled_from(["keep", "at_next_entry"]), st.data())
def test_an_equal_plot_changes_nothing(plots, happened, active, data):
    played, other = Played(*plots), Played(*plots)
    others = other.steps(happened)
    for number, _ in enumerate(played.steps(happened)):
        next(others, None)
        if data.draw(st.booleans(), label=f"changed after step {number}"):
            forms = {plot.name: plot.to_form() for plot in played.library}
            step = played.machine.replace_plots(played.library, forms, active, played.situation())
            assert not step.output
            assert not [path for micro in step.microsteps for path in (*micro.exited, *micro.entered)]
        assert pinned(played.machine.state) == pinned(other.machine.state)


@settings(PROPERTY, max_examples=80)
@given(
    libraries(depth=2), libraries(depth=2), happenings(), happenings(),
    st.sampled_from(["keep", "restart", "at_next_entry"]),
)  # fmt: skip
def test_a_machine_continues_in_any_other_plots(plots, others, happened, later, active):
    played = Played(*plots)
    for _ in played.steps(happened):
        pass
    before, forms = played.machine.state, {plot.name: plot.to_form() for plot in plots}
    played.library.change({plot.name: plot for plot in others})
    try:
        step = played._commit(played.machine.replace_plots(played.library, forms, active, played.situation()))
    except (InputError, RunawayError):
        assert played.machine.state is before
        return
    assert read_state(played.machine.state.to_json(), played.library) == played.machine.state
    active_now = [frame.compiled for frame in played.machine.state.root.frames()] if played.machine.state.root else []
    if active != "at_next_entry":
        assert all(one.form is None or one.plot.name not in forms for one in active_now)
    _require_balance(before, step)
    try:
        for what, which, attributes in later:
            event = played.event(what, which, attributes)
            if event is not None:
                played.after(played._commit(played.machine.send(event, played.situation())))
    except RunawayError:
        return


def _require_balance(before: MachineState, step: Step) -> None:
    """Require that entries and exits lead from the states before to those after."""
    present = list(before.configuration())
    for micro in step.microsteps:
        for path in micro.exited:
            present.remove(path)
        present += micro.entered
    assert sorted(present) == sorted(step.state.configuration())
