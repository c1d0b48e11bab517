"""A warning names regions and handlers whose skills wait for each other at one component (S1.21)."""

import pytest
from dsc_charts import plot

from dsc import Library
from dsc.validation import review_plot

REGIONS = """
plot: p
states:
  both:
    regions:
      left: {states: {l: {MORE entry: {trigger: arm.move}, on: {moved: le}}, le: {final: true}}}
      right: {states: {r: {use: inner, on: {done: re}}, re: {final: true}}}
    on: {done: over}
  over: {final: true}
"""
INNER = "{plot: inner, states: {i: {entry: {trigger: arm.move}, on: {moved: e}}, e: {final: true}}}"
HANDLER = """
plot: p
receives: {hot: }
states:
  work: {entry: {trigger: arm.move}, on: {moved: over}}
  over: {final: true}
handlers:
  - {on: hot, MORE do: {use: inner}}
"""


def said(text, exclusive=("arm.move",)):
    library = Library([plot(text), plot(INNER)])
    return [str(one.error.message) for one in review_plot(library.plot("p"), library, exclusive=exclusive)]


def test_regions_that_wait_for_each_other_are_named_with_the_component():
    (message,) = said(REGIONS.replace("MORE", ""))
    assert message.startswith("the regions 'left' and 'right' of state 'both' wait for each other at component 'arm'")


def test_a_handler_that_waits_for_its_plot_is_named():
    assert said(HANDLER.replace("MORE", "")) == [
        "the 'handler hot: inner' waits for its plot at component 'arm', which executes one skill at a time"
    ]


@pytest.mark.parametrize(
    "text",
    [
        REGIONS.replace("MORE", "priority: 1,"),
        HANDLER.replace("MORE", "interrupt: true,"),
        HANDLER.replace("MORE", "preempt: true,"),
        HANDLER.replace("MORE", "priority: -1,"),
    ],
)
def test_a_plot_that_declares_a_priority_has_no_warning(text):
    assert said(text) == []


@pytest.mark.parametrize("text", [REGIONS, HANDLER])
def test_concurrent_components_and_events_cause_no_warning(text):
    assert said(text.replace("MORE", ""), exclusive=()) == []
