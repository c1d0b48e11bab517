"""Poses in a run: guards, candidates and arguments read a transform tree, and a chart publishes to it."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from dsc_charts import plot

from dsc.dynamic.library import Library
from dsc.events import Event
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from knowledge_base import Delta, KnowledgeBase, Schema, Transform, TransformTree, computed, fact


@computed("(near ?a ?b - object)", reads=["(pose ?a ?b)"])
def near(pose) -> bool:
    return bool(pose) and sum(x * x for x in pose[:3]) < 1


SCHEMA = Schema.parse("""(define (domain d) (:functions (pose ?frame ?reference - object) - geometry)
  (:constants map base cup1 gripper - object))""").with_computed(near)
WAITS = """
    plot: p
    receives: {quit: }
    states:
      a: {always: {to: e, when: (near cup1 base)}, on: {quit: e}}
      e: {final: true}
"""
CHOOSES = """
    plot: p
    outputs: {found: {type: optional geometry, initial: null}}
    states:
      a: {dynamic: [far, close], with: {pose: (pose cup1 base)}, on: {done: b}}
      b: {entry: {assign: {found: (pose cup1 map)}}, always: e}
      e: {final: true}
"""
CANDIDATES = [
    "{plot: far, when: (not (near cup1 base)), parameters: {pose: {type: geometry}}, states: {e: {final: true}}}",
    "{plot: close, when: (near cup1 base), parameters: {pose: {type: geometry}}, states: {e: {final: true}}}",
]


def world() -> tuple[KnowledgeBase, TransformTree]:
    kb, tree = KnowledgeBase(SCHEMA), TransformTree()
    kb.bind_transforms("pose", tree)
    tree.update("map", "base", Transform(), 0)
    tree.update("map", "cup1", Transform((9, 0, 0)), 0)
    return kb, tree


@pytest.mark.parametrize("threaded", [False, True])
def test_an_update_of_the_tree_wakes_a_waiting_guard(threaded):
    async def main():
        kb, tree = world()
        sequencer = Sequencer(Library([plot(WAITS)]), kb, [], LoopClock(), open_ended=True)
        steps: list[Any] = []
        sequencer.listen(steps.append)

        async def drive():
            for second in range(1, 10):
                await asyncio.sleep(1)
                for child, x in (("base", second), ("cup1", 9)):
                    news = "map", child, Transform((x, 0, 0)), second
                    if threaded:
                        await asyncio.to_thread(tree.update, *news)
                    else:
                        tree.update(*news)

        sequencer.post(Event("quit"), after=60)
        end, _ = await asyncio.gather(sequencer.run("p"), drive())
        return end, len(steps), kb.version

    assert run_simulated(main())[1:] == (2, 0)  # only the pose that enables the transition causes a macrostep


def test_candidates_and_arguments_read_poses():
    async def main():
        kb, _ = world()
        sequencer = Sequencer(Library([plot(CHOOSES), *map(plot, CANDIDATES)]), kb, [], LoopClock())
        decisions: list[Any] = []
        sequencer.listen(lambda step: decisions.extend(step.decisions))
        end = await sequencer.run("p")
        return end, decisions

    end, [decision] = run_simulated(main())
    assert (decision.decision.chosen, decision.decision.arguments) == ("far", {"pose": [9, 0, 0, 0, 0, 0, 1]})
    assert end.outputs == {"found": [9, 0, 0, 0, 0, 0, 1]}


GRASPS = """
    plot: p
    states:
      a:
        entry:
          tell: (and (assign (pose cup1 map) (geometry)) (assign (pose cup1 gripper) (geometry 0 0 0 0 0 0 1)))
        always: {to: e, when: (near cup1 gripper)}
      e: {final: true}
"""


def test_a_chart_publishes_to_the_tree():
    async def main():
        kb, tree = world()
        end = await Sequencer(Library([plot(GRASPS)]), kb, [], LoopClock()).run("p")
        return end, tree.parent("cup1"), kb.version

    end, parent, version = run_simulated(main())
    assert (end.finished, end.problem, parent, version) == (True, None, "gripper", 0)


def test_an_impossible_arc_is_a_problem_of_the_run():
    async def main():
        kb, tree = world()
        kb.apply(Delta(values={fact("pose", "gripper", "base"): Transform().numbers}), "test")
        refused = GRASPS.replace("(assign (pose cup1 map) (geometry))", "")
        sequencer = Sequencer(Library([plot(refused)]), kb, [], LoopClock(), open_ended=True)
        asyncio.get_running_loop().call_later(1, sequencer.stop, "test")
        return await sequencer.run("p"), tree.parent("cup1")

    end, parent = run_simulated(main())
    assert "'cup1' has the parent 'map'" in str(end.problem)
    assert parent == "map"
