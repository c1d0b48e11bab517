"""Nodes of Nav2: each case has the results of the leaves, and what each tick returns and calls."""

import pytest
from tree_replays import replay

from dsc.trees.reading.reader import parse_trees
from knowledge_base import InputError

TREE = '<root BTCPP_format="4"><BehaviorTree ID="Main">{}</BehaviorTree></root>'
LEAVES = "".join(f'<Act name="{name}"/>' for name in "abc")
RECOVERY = '<RecoveryNode number_of_retries="{}"><Act name="a"/><Act name="b"/></RecoveryNode>'
PIPELINE = f"<PipelineSequence>{LEAVES}</PipelineSequence>"
ROUND = f"<RoundRobin>{LEAVES}</RoundRobin>"
WRAP = f'<RoundRobin wrap_around="true">{LEAVES}</RoundRobin>'
RATE = '<RateController hz="2"><Act name="a"/></RateController>'
OK, NO, GO, SKIP = "success", "failure", "running", "skipped"
KEEP = "<KeepRunningUntilFailure>{}</KeepRunningUntilFailure>"
CASES = {
    "a recovery tries again": (RECOVERY.format(1), {"a": [NO, GO, OK], "b": [GO, OK]}, [
        (GO, "start a, start b"), (GO, "resume b, start a"), (OK, "resume a"),
    ]),
    "a recovery gives up": (RECOVERY.format(2), {"a": [NO], "b": [OK]}, [
        (NO, "start a, start b, start a, start b, start a"), (NO, "start a, start b, start a, start b, start a"),
    ]),
    "a recovery without retries": (RECOVERY.format(0), {"a": [NO]}, [(NO, "start a")]),
    "a repair that fails": (RECOVERY.format(3), {"a": [NO], "b": [NO]}, [(NO, "start a, start b")]),
    "retries are counted anew": (RECOVERY.format(1), {"a": [NO, OK, NO, OK], "b": [OK]}, [
        (OK, "start a, start b, start a"), (OK, "start a, start b, start a"),
    ]),
    "a skipped part is skipped": (RECOVERY.format(1).replace('name="a"', 'name="a" _skipIf="true"'), {}, [(SKIP, "")]),
    "a skipped repair is a failure": (
        RECOVERY.format(1).replace('name="b"', 'name="b" _skipIf="true"'), {"a": [NO]}, [(NO, "start a")],
    ),
    "earlier parts of a pipeline go on": (PIPELINE, {"a": [OK], "b": [GO, GO, OK], "c": [GO, NO]}, [
        (GO, "start a, start b"), (GO, "resume b"), (GO, "resume b, start c"), (NO, "resume c"),
    ]),
    "a running part is passed": (
        PIPELINE.replace('<Act name="a"/>', RATE.replace("2", "10")), {"a": [OK, GO, GO, OK], "b": [GO, OK], "c": [GO, OK]}, [
            (GO, "start a, start b"), (GO, "start a, resume b, start c"), (OK, "resume a, resume c, stop a"),
        ],
    ),
    "a pipeline stops at its farthest part": (PIPELINE, {"a": [GO, OK], "b": [OK], "c": [OK]}, [
        (GO, "start a"), (OK, "resume a, start b, start c"),
    ]),
    "a skipped pipeline": (PIPELINE.replace("<Act", '<Act _skipIf="true"'), {}, [(SKIP, "")]),
    "the next child after a failure": (ROUND, {"a": [NO], "b": [GO, OK], "c": [GO, NO]}, [
        (GO, "start a, start b"), (OK, "resume b"), (GO, "start c"), (NO, "resume c"),
    ]),
    "the last child succeeds": (ROUND, {"a": [NO], "b": [NO], "c": [OK]}, [
        (OK, "start a, start b, start c"), (OK, "start a, start b, start c"),
    ]),
    "wrapped around": (WRAP, {"a": [OK, NO, NO], "b": [OK, NO, NO], "c": [NO]}, [
        (OK, "start a"), (OK, "start b"), (NO, "start c, start a, start b"), (NO, "start a, start b, start c"),
    ]),
    "all are skipped": (WRAP.replace("<Act", '<Act _skipIf="true"'), {}, [(SKIP, "")]),
    "a rate of 2 Hz at ticks of 0.1 s": (KEEP.format(f"<PipelineSequence>{RATE}</PipelineSequence>"), {"a": [OK, GO, OK]}, [
        (GO, "start a"), (GO, "start a"), (GO, "resume a"), (GO, "start a"),
    ]),
    "a rate in a pipeline": (f'<PipelineSequence>{RATE}<Act name="b"/></PipelineSequence>', {"a": [OK], "b": [GO]}, [
        (GO, "start a, start b"), *[(GO, "resume b")] * 4, (GO, "start a, resume b"), (GO, "resume b"),
    ]),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_ticks_of_nodes_of_nav2(case):
    body, results, ticks = CASES[case]
    found = replay({"xml": TREE.format(body), "results": results, "pause": 100, "ticks": ticks})
    assert [(status, ", ".join(calls)) for status, calls, _ in found] == ticks


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("<RecoveryNode><Act/></RecoveryNode>", "<RecoveryNode> has 2 children; found 1"),
        ('<RateController hz="often"><Act/></RateController>', "the port 'hz' is a number or a {key}, not 'often'"),
        (
            "<GoalUpdater><Act/></GoalUpdater>",
            "<GoalUpdater> has no counterpart: write an action that updates the goal",
        ),
    ],
)
def test_mistakes_at_nodes_of_nav2(body, said):
    with pytest.raises(InputError) as caught:
        parse_trees(TREE.format(body), "nav.xml")
    assert str(caught.value).startswith("nav.xml:1:")
    assert said in str(caught.value)


@pytest.mark.parametrize("rate", ["0", "-1"])
def test_a_rate_that_is_not_above_0(rate):
    tree = TREE.format(RATE.replace("2", rate))
    assert replay({"xml": tree, "results": {}, "pause": 100, "ticks": [0]}) == [["error", [], {}]]
