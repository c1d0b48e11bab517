"""Parameters of one entry are one set, which a component validates as a whole (S1.20)."""

from __future__ import annotations

from typing import Any

import pytest
from dsc_charts import plot
from hypothesis import given
from hypothesis import strategies as st

from dsc import Component, Library, LoopClock, Outcome, Parameters, RunEnd, Sequencer, SkillCall, skill
from dsc.sequencer.clock import run_simulated
from dsc.wire import Host, RemoteComponent
from dsc.wire.endpoint import LocalTransport
from knowledge_base import KnowledgeBase, Schema


class Seen(Outcome): ...


class BandParameters(Parameters):
    low: float = 0
    middle: float = 1
    high: float = 2
    relations = ("(<= ?low ?middle)", "(<= ?middle ?high)")


class Band(Component):
    name = "band"
    modes = ("fast",)
    parameters: BandParameters

    def __init__(self) -> None:
        super().__init__()
        self.calls: list[tuple[str, Any]] = []

    async def configure(self, parameter: str, value: Any) -> None:
        await super().configure(parameter, value)
        self.calls.append((parameter, value))

    async def switch(self, mode: str) -> None:
        self.calls.append(("mode", mode))
        await super().switch(mode)

    @skill
    async def look(self, call: SkillCall) -> Seen:
        self.calls.append(("look", dict(self.parameters)))
        return Seen()


def ran(text: str, *, hosted: bool = False) -> tuple[Band, RunEnd]:
    """Return the band and the end of a run."""
    band = Band()

    async def main() -> RunEnd:
        components: list[Component] = [band]
        if hosted:
            transport = LocalTransport()
            host = Host(band, transport, LoopClock())
            components = [await RemoteComponent.connect("band", transport)]
        end = await Sequencer(Library([plot(text)]), KnowledgeBase(Schema()), components, LoopClock()).run("p")
        if hosted:
            await host.close()
        return end

    return band, run_simulated(main())


def entering(actions: str) -> str:
    return f"{{plot: p, states: {{a: {{entry: [{actions}, {{trigger: band.look}}], on: {{seen: e}}}}, e: {{final: true}}}}}}"


def sets(values: dict[str, float]) -> str:
    return ", ".join(f"{{set: band.{name}, to: {value}}}" for name, value in values.items())


@pytest.mark.parametrize("hosted", [False, True], ids=["local", "hosted"])
@given(order=st.permutations(["low", "middle", "high"]), values=st.lists(st.integers(-9, 9), min_size=3, max_size=3))
def test_a_set_is_validated_as_a_whole_in_any_order(hosted, order, values):
    wanted = dict(zip(order, values, strict=True))
    band, end = ran(entering(sets(wanted)), hosted=hosted)
    if wanted["low"] <= wanted["middle"] <= wanted["high"]:
        assert (dict(band.parameters), end.reached) == (wanted, True)
    else:
        assert dict(band.parameters) == {"low": 0, "middle": 1, "high": 2}
        assert "component 'band' needs (<= " in end.reason


def test_a_switch_between_parameters_keeps_its_place():
    actions = f"{sets({'high': 9, 'middle': 8})}, {{switch: band, to: fast}}, {sets({'low': 7})}"
    band, end = ran(entering(actions))
    assert end.reached
    assert [name for name, _ in band.calls] == ["high", "middle", "mode", "low", "look"]


def test_a_parameter_that_is_set_again_begins_another_set():
    band, end = ran(entering(f"{sets({'high': 9})}, {sets({'high': 5})}"))
    assert (band.calls[:2], end.reached) == ([("high", 9), ("high", 5)], True)


def test_the_exit_and_the_next_entry_are_two_sets():
    band, end = ran("""
    plot: p
    states:
      a: {entry: {trigger: band.look}, exit: {set: band.high, to: 5}, on: {seen: b}}
      b: {entry: {set: band.middle, to: 9}, after: {seconds: 1, to: e}}
      e: {final: true}
    """)
    assert "needs (<= ?middle ?high)" in end.reason
    assert dict(band.parameters) == {"low": 0, "middle": 1, "high": 5}
