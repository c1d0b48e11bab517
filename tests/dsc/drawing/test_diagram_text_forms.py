"""What Mermaid and PlantUML say about charts whose transitions cross borders."""

from __future__ import annotations

import pytest
from dsc_charts import plot

from dsc.text.text_diagrams import to_mermaid, to_plantuml

CHART = plot("""
    plot: p
    dialect: scxml
    states:
      a: {on: {go: {to: b, also: [c]}}}
      o:
        entry: {emit: entered}
        on: {again: {emit: heard}, in: {to: b, internal: true}}
        regions: {left: {states: {u: , b: }}, right: {states: {v: , c: }}}
        connectors: {h: {history: deep, to: c}}
    """)


@pytest.mark.parametrize("write", [to_mermaid, to_plantuml])
def test_edges_lead_to_every_target_wherever_it_is(write):
    lines = [line.strip() for line in write(CHART).splitlines()]
    alias = {name: next(line.split()[-1] for line in lines if line.startswith(f'state "{name}')) for name in "abcoh"}
    for source, target, text in (("a", "b", "go"), ("a", "c", "go"), ("o", "b", "in {internal}")):
        assert f"{alias[source]} --> {alias[target]} : {text}" in lines
    assert f"{alias['h']} --> {alias['c']}" in lines


def test_mermaid_has_no_rows_in_states_with_states_inside():
    assert 'state "o<br/>entry / ^entered<br/>again / ^heard" as s2' in to_mermaid(CHART)
    assert "s2 : " not in to_mermaid(CHART).replace("--> s2 : ", "")


def test_plantuml_has_rows_in_all_states():
    lines = [line.strip() for line in to_plantuml(CHART).splitlines()]
    assert {"s2 : entry / ^entered", "s2 : again / ^heard"} <= set(lines)
