"""Behaviour trees of our own writing, for the comparison with BehaviorTree.CPP.

`Act` is an action with several ticks, `Test` a condition; their results are lists. This module imports only the standard
library, as the environment of the other program has nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

R, S, F = "running", "success", "failure"


@dataclass(frozen=True)
class Case:
    """A file, the results of its leaves by name, the number of ticks, and the milliseconds before each tick but the first."""

    name: str
    xml: str
    results: Mapping[str, list[str]] = field(default_factory=dict)
    ticks: int = 8
    pause: int = 0


def xml(body: str, more: str = "") -> str:
    """Return a file with the tree `Main`."""
    return (
        f'<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main">{body}</BehaviorTree>{more}</root>'
    )


def case(name: str, body: str, more: str = "", ticks: int = 8, pause: int = 0, **results: Any) -> Case:
    """Return a case with the tree `Main`; a leaf without results always succeeds."""
    return Case(name, xml(body, more), results, ticks, pause)


ABC = '<Act name="a"/><Act name="b"/><Act name="c"/>'
SLOW, QUICK, LATE = [R, S], [S], [R, R, F]
ABC_RESULTS: dict[str, Any] = {"a": [R, S, S], "b": [S, R, F, S], "c": [R, R, S]}
SUBTREE = '<BehaviorTree ID="Inner"><Sequence><Script code="result := n * 2"/><Act name="i"/></Sequence></BehaviorTree>'

# fmt: off
OWN = [
    case('sequence', f'<Sequence>{ABC}</Sequence>', **ABC_RESULTS, ticks=16),
    case('sequence restarts', f'<Sequence>{ABC}</Sequence>', a=[S], b=[F, S], c=[R, F, S], ticks=10),
    case('async sequence', f'<AsyncSequence>{ABC}</AsyncSequence>', a=[S], b=[R, S, S], c=[S, F], ticks=12),
    case('async sequence in reactive', f'<ReactiveSequence><Test name="t"/><AsyncSequence>{ABC}</AsyncSequence></ReactiveSequence>', t=[S, S, F, S], a=[S], b=[S], c=[R, S], ticks=12),
    case('sequence with memory', f'<SequenceWithMemory>{ABC}</SequenceWithMemory>', a=[S], b=[F, F, S], c=[R, F, S], ticks=14),
    case('memory outlives a halt', f'<ReactiveSequence><Test name="t"/><SequenceWithMemory>{ABC}</SequenceWithMemory></ReactiveSequence>', t=[S, S, F, S], a=[R, S], b=[R, R, S], c=[S, F], ticks=14),
    case('reactive sequence', f'<ReactiveSequence><Test name="t"/>{ABC}</ReactiveSequence>', t=[S, S, S, F], **ABC_RESULTS, ticks=14),
    case('reactive sequence of actions', f'<ReactiveSequence>{ABC}</ReactiveSequence>', a=[S, R, S], b=[R, S], c=[R, R, S], ticks=14),
    case('fallback', f'<Fallback>{ABC}</Fallback>', a=[F, R, F], b=[R, F, S], c=[S, R, F], ticks=14),
    case('fallback of conditions', '<Fallback><Test name="t"/><Test name="u"/><Act name="a"/></Fallback>', t=[F, F, S], u=[F, S], a=[R, S, F], ticks=12),
    case('async fallback', f'<AsyncFallback>{ABC}</AsyncFallback>', a=[F], b=[F, R, F], c=[F, S], ticks=12),
    case('async fallback in reactive', f'<ReactiveFallback><Test name="t"/><AsyncFallback>{ABC}</AsyncFallback></ReactiveFallback>', t=[F, F, S], a=[F], b=[F], c=[R, S], ticks=12),
    case('reactive fallback', f'<ReactiveFallback><Test name="t"/>{ABC}</ReactiveFallback>', t=[F, F, S], a=[F], b=[R, F], c=[R, R, S, F], ticks=14),
    case('reactive fallback of actions', f'<ReactiveFallback>{ABC}</ReactiveFallback>', a=[F, R, F], b=[R, R, F], c=[S], ticks=14),
    case('parallel', f'<Parallel success_count="2" failure_count="2">{ABC}</Parallel>', a=[R, R, S], b=[R, F], c=[R, R, R, S], ticks=14),
    case('parallel of all', f'<Parallel>{ABC}</Parallel>', a=[R, S], b=[R, R, S], c=[S, S, F], ticks=14),
    case('parallel negative', f'<Parallel success_count="-2" failure_count="-1">{ABC}</Parallel>', a=[R, F], b=[F, R, S], c=[R, R, F], ticks=14),
    case('parallel with skipped children', '<Parallel success_count="-1"><Act name="a" _skipIf="true"/><Act name="b"/></Parallel>', b=[R, S], ticks=6),
    case('parallel all', f'<ParallelAll max_failures="2">{ABC}</ParallelAll>', a=[F], b=[R, R, F], c=[R, S, S], ticks=14),
    case('parallel all default', f'<ParallelAll>{ABC}</ParallelAll>', a=[S], b=[R, R, S], c=[R, S, F], ticks=14),
    case('inverter', '<Sequence><Inverter><Act name="a"/></Inverter><Inverter><Test name="t"/></Inverter></Sequence>', a=[R, F, S], t=[F, S], ticks=10),
    case('force success', '<Sequence><ForceSuccess><Act name="a"/></ForceSuccess><Inverter><ForceSuccess><Act name="b"/></ForceSuccess></Inverter></Sequence>', a=[R, F], b=[F, S]),
    case('force failure', '<Fallback><ForceFailure><Act name="a"/></ForceFailure><ForceFailure><Act name="b"/></ForceFailure></Fallback>', a=[R, S], b=[S, F]),
    case('repeat', '<Repeat num_cycles="3"><Act name="a"/></Repeat>', a=[S, R, S, S, S, F], ticks=14),
    case('repeat in sequence', f'<Sequence><Repeat num_cycles="2"><Sequence>{ABC}</Sequence></Repeat><Act name="d"/></Sequence>', a=[S], b=[R, S], c=[S, S, F], d=[R, F], ticks=16),
    case('retry', '<RetryUntilSuccessful num_attempts="3"><Act name="a"/></RetryUntilSuccessful>', a=[F, R, F, F, F, S], ticks=14),
    case('retry forever', '<RetryUntilSuccessful num_attempts="-1"><Sequence><Test name="t"/><Act name="a"/></Sequence></RetryUntilSuccessful>', t=[F, S], a=[R, F, F, S], ticks=14),
    case('keep running', '<KeepRunningUntilFailure><Act name="a"/></KeepRunningUntilFailure>', a=[S, R, S, F], ticks=10),
    case('run once', '<Sequence><RunOnce><Act name="a"/></RunOnce><Act name="b"/></Sequence>', a=[R, S], b=[R, S, F], ticks=12),
    case('run once again', '<Fallback><RunOnce then_skip="false"><Act name="a"/></RunOnce><Act name="b"/></Fallback>', a=[R, F], b=[S, R, F], ticks=12),
    case('if then else', f'<IfThenElse>{ABC}</IfThenElse>', a=[R, S, F, S], b=[R, S], c=[R, F], ticks=16),
    case('if then', '<IfThenElse><Test name="t"/><Act name="a"/></IfThenElse>', t=[F, S, S], a=[R, S, F], ticks=10),
    case('while do else', '<WhileDoElse><Test name="t"/><Act name="a"/><Act name="b"/></WhileDoElse>', t=[S, S, F, F, S], a=[R, R, S], b=[R, F], ticks=14),
    case('while do', '<WhileDoElse><Test name="t"/><Act name="a"/></WhileDoElse>', t=[S, S, F, S], a=[R, R, S], ticks=12),
    case('while of an action', '<WhileDoElse><Act name="t"/><Act name="a"/><Act name="b"/></WhileDoElse>', t=[R, S, F], a=[R, R, S], b=[R, F], ticks=12),
    case('switch 2', '<Sequence><Script code="x := 1"/><KeepRunningUntilFailure><Switch2 variable="{x}" case_1="1" case_2="2"><Act name="a" _onSuccess="x = 2"/><Act name="b" _post="x = 3"/><Act name="c"/></Switch2></KeepRunningUntilFailure></Sequence>', a=[R, S], b=[R, S], c=[R, F], ticks=14),
    case('switch 3', '<Sequence><SetBlackboard value="blue" output_key="x"/><Switch3 variable="{x}" case_1="red" case_2="green" case_3="blue"><Act name="a"/><Act name="b"/><Act name="c"/><Act name="d"/></Switch3></Sequence>', c=[R, S, F], ticks=8),
    case('switch 4 without variable', f'<Switch4 variable="{{none}}" case_1="1" case_2="2" case_3="3" case_4="4">{ABC}<Act name="d"/><Act name="e"/></Switch4>', e=[R, S, F], ticks=8),
    case('switch 5 of numbers', f'<Sequence><Script code="x := 4.0"/><Switch5 variable="{{x}}" case_1="1" case_2="2" case_3="3" case_4="4" case_5="5">{ABC}<Act name="d"/><Act name="e"/><Act name="f"/></Switch5></Sequence>', d=[R, S, F], ticks=8),
    case('switch 6', f'<Sequence><Script code="x := 6"/><Switch6 variable="{{x}}" case_1="1" case_2="2" case_3="3" case_4="4" case_5="5" case_6="6">{ABC}<Act name="d"/><Act name="e"/><Act name="f"/><Act name="g"/></Switch6></Sequence>', f=[R, S, F], ticks=8),
    case('running switch changes', '<Sequence><Script code="x := 1"/><Parallel success_count="2" failure_count="2"><Switch2 variable="{x}" case_1="1" case_2="2"><Act name="a"/><Act name="b"/><Act name="c"/></Switch2><KeepRunningUntilFailure><Sequence><Act name="d"/><Script code="x = x + 1"/></Sequence></KeepRunningUntilFailure></Parallel></Sequence>', a=[R], b=[R], c=[R], d=[R, S], ticks=12),
    case('switch 3 keeps running', f'<Sequence><Script code="x := 2"/><ReactiveFallback><Test name="t"/><Switch3 variable="{{x}}" case_1="1" case_2="2" case_3="3">{ABC}<Act name="d"/></Switch3></ReactiveFallback></Sequence>', t=[F, F, S], b=[R, R, F], ticks=10),
    case('switch 4 of texts', f"""<Sequence><Script code="x := 'two'"/><Switch4 variable="{{x}}" case_1="one" case_2="two" case_3="three" case_4="four">{ABC}<Act name="d"/><Act name="e"/></Switch4></Sequence>""", b=[R, S, F], ticks=8),
    case('switch 5 and 6 skipped', f"""<Fallback><Switch5 variable="3" case_1="1" case_2="2" case_3="3" case_4="4" case_5="5">{ABC.replace('/>', ' _skipIf=' + chr(34) + 'true' + chr(34) + '/>')}<Act name="d"/><Act name="e"/><Act name="f"/></Switch5><Switch6 variable="{{y}}" case_1="1" case_2="2" case_3="3" case_4="4" case_5="5" case_6="6">{ABC}<Act name="d"/><Act name="e"/><Act name="f"/><Act name="g"/></Switch6></Fallback>""", g=[R, S, F], ticks=8),
    case('success attribute', '<Fallback><Act name="a" _successIf="false" _failureIf="true"/><ForceFailure _successIf="true"><Act name="b"/></ForceFailure></Fallback>', ticks=3),
    case('force failure in reactive', '<ReactiveSequence><Test name="t"/><Fallback><ForceFailure><Act name="a"/></ForceFailure><KeepRunningUntilFailure><Act name="b"/></KeepRunningUntilFailure></Fallback></ReactiveSequence>', t=[S, S, S, F], a=[R, S], b=[R, S, F], ticks=12),
    case('constants', '<Fallback><AlwaysFailure/><Inverter><AlwaysSuccess/></Inverter><Act name="a"/></Fallback>', a=[R, S, F]),
    case('constants skipped', '<Sequence><AlwaysSuccess _skipIf="true"/><AlwaysFailure _while="false"/></Sequence>', ticks=3),
    case('subtree', '<Sequence><Script code="k := 3"/><SubTree ID="Inner" n="{k}" result="{out}"/><ScriptCondition code="out == 6"/><Act name="a"/></Sequence>', SUBTREE, i=[R, S], a=[S, F], ticks=8),
    case('subtree autoremap', '<Sequence><Script code="n := 4; _p := 1"/><SubTree ID="Inner" _autoremap="true"/><ScriptCondition code="result == 8"/></Sequence>', SUBTREE, i=[R, S, S], ticks=8),
    case('subtree with a global key', '<Sequence><Script code="g := 1"/><SubTree ID="Deep"/><ScriptCondition code="g == 2"/></Sequence>', '<BehaviorTree ID="Deep"><SubTree ID="Deeper"/></BehaviorTree><BehaviorTree ID="Deeper"><Script code="@g = 2"/></BehaviorTree>', ticks=3),
    case('subtree halted', '<ReactiveSequence><Test name="t"/><SubTree ID="Inner" n="{k}" _onHalted="h := 1"/></ReactiveSequence>', '<BehaviorTree ID="Inner"><Sequence><Act name="i"/><Act name="j"/></Sequence></BehaviorTree>', t=[S, S, F, S], i=[R, S], j=[R, R, S], ticks=12),
    case('precondition', '<Sequence><Script code="x := 1"/><Precondition if="x == 1" else="SKIPPED"><Act name="a" _post="x = 2"/></Precondition><Precondition if="x == 1" else="FAILURE"><Act name="b"/></Precondition></Sequence>', a=[R, S], ticks=8),
    case('precondition halted', '<Sequence><Script code="x := 1"/><ReactiveSequence><Test name="t"/><Precondition if="x == 1"><Act name="a" _onHalted="x = 2"/></Precondition></ReactiveSequence></Sequence>', t=[S, F, S], a=[R, R, R, S], ticks=12),
    case('conditions of nodes', '<Sequence><Script code="x := 0"/><Act name="a" _successIf="x == 1"/><Act name="b" _failureIf="x == 2" _onFailure="y := 1"/><Script code="x = 2"/><Fallback><Act name="c" _failureIf="x == 2"/><Act name="d" _skipIf="x == 2"/><Act name="e" _successIf="x == 2"/></Fallback></Sequence>', a=[R, S], b=[R, S]),
    case('while attribute', '<Sequence><Script code="x := 0"/><Parallel success_count="1" failure_count="2"><Act name="a" _while="x &lt; 2" _onHalted="h := 1"/><KeepRunningUntilFailure><Act name="b" _onSuccess="x += 1"/></KeepRunningUntilFailure></Parallel></Sequence>', a=[R], b=[R, S], ticks=12),
    case('scripts after the end', '<Sequence><Script code="n := 0; m := 0"/><Repeat num_cycles="3"><Fallback _onSuccess="n += 1" _onFailure="n -= 1" _post="m += 1"><Act name="a"/><Act name="b" _onFailure="m *= 2"/></Fallback></Repeat></Sequence>', a=[F, S, F], b=[R, S, F], ticks=12),
    case('arithmetic', '<Sequence><Script code="a := 7; b := a / 2; c := -a + 2 * 3 - 1; d := (a + b) * 2; e := 1.5e1; f := 0x1F; g := a; g *= 2; h := b; h -= 0.5; i := 5; i /= 5"/></Sequence>', ticks=2),
    case('logic', '<Sequence><Script code="a := 1 &lt; 2; b := 1 &lt; 2 &lt; 2; c := !true; d := true &amp;&amp; false || true; e := 2 == 2.0; f := \'x\' == \'y\'; g := \'abc\' &lt; \'abd\'; h := 3 &gt; 2 ? 10 : 20; i := false ? 1 : (true ? 2 : 3); j := 1 != 2; k := 4 &gt;= 4; l := \'3\' == 3"/></Sequence>', ticks=2),
    case('texts', '<Sequence><Script code="a := \'one\'; b := a .. \' two\'; c := \'n\' .. 3; d := \'x\' .. 1.5; e := a + b; a = \'changed\'; f := a; f += \'!\'"/><SetBlackboard value="plain" output_key="h"/></Sequence>', ticks=2),
    case('copied entry', '<Sequence><Script code="b := 5"/><SetBlackboard value="{b}" output_key="g"/><ScriptCondition code="g == 5"/><ForceSuccess><AlwaysFailure/></ForceSuccess></Sequence>', ticks=3),
    case('missing entry', '<Sequence><Act name="a"/><Script code="x = 1"/></Sequence>', ticks=3),
    case('missing operand', '<Sequence><Act name="a"/><ScriptCondition code="x == 1"/></Sequence>', ticks=3),
    case('integer stays', '<Sequence><Script code="x := 3; x = 4.0; y := x + 0.5"/><Act name="a"/><Script code="x = y"/></Sequence>', ticks=3),
    case('unset', '<Sequence><Script code="x := 1"/><UnsetBlackboard key="x"/><Act name="a"/><ScriptCondition code="x == 1"/></Sequence>', ticks=3),
    case('unset in a subtree', '<Sequence><Script code="x := 1"/><SubTree ID="Inner" _autoremap="true"/><ScriptCondition code="x == 1"/></Sequence>', '<BehaviorTree ID="Inner"><UnsetBlackboard key="x"/></BehaviorTree>', ticks=3),
    case('count from the blackboard', '<Sequence><SetBlackboard value="3" output_key="n"/><Repeat num_cycles="{n}"><Act name="a"/></Repeat><RetryUntilSuccessful num_attempts="{n}"><Act name="b"/></RetryUntilSuccessful></Sequence>', a=[S, R, S], b=[F, R, F, S], ticks=14),
    case('attempts change', '<Sequence><Script code="n := 5"/><RetryUntilSuccessful num_attempts="{n}"><Act name="a" _onFailure="n -= 1"/></RetryUntilSuccessful></Sequence>', a=[F], ticks=8),
    case('skipped sequence is halted', '<ReactiveSequence><Test name="t"/><Sequence _onHalted="h := 1"><Act name="a" _skipIf="true"/></Sequence><Act name="b"/></ReactiveSequence>', t=[S, S, F], b=[R, S], ticks=8),
    case('skipped repeat', '<Fallback><Repeat num_cycles="3"><Act name="a" _skipIf="x == 1" _onSuccess="x := 1"/></Repeat><Act name="b"/></Fallback>', a=[S], b=[R, S], ticks=5),
    case('skipped in if', '<IfThenElse><Act name="a" _skipIf="true"/><Act name="b"/></IfThenElse>', ticks=2),
    case('skipped in while', '<WhileDoElse><Act name="a" _skipIf="true"/><Act name="b"/></WhileDoElse>', ticks=2),
    case('threshold too large', '<Parallel success_count="3"><Act name="a"/><Act name="b"/></Parallel>', ticks=2),
    case('sleep', '<Sequence><Act name="a"/><Sleep msec="150"/><Act name="b"/></Sequence>', a=[S], b=[R, S], ticks=7, pause=60),
    case('sleep halted', '<ReactiveSequence><Test name="t"/><Sequence><Sleep msec="150"/><Act name="b"/></Sequence></ReactiveSequence>', t=[S, S, F, S, S, S, S, S], b=[R, S], ticks=9, pause=60),
    case('delay', '<Sequence><Delay delay_msec="150"><Act name="a"/></Delay><Act name="b"/></Sequence>', a=[R, S], b=[S, F], ticks=10, pause=60),
    case('delay halted', '<ReactiveSequence><Test name="t"/><Delay delay_msec="90"><Act name="a"/></Delay></ReactiveSequence>', t=[S, S, S, F, S, S, S, S], a=[R, R, R, S], ticks=9, pause=60),
    case('timeout', '<Sequence><Timeout msec="150"><Act name="a"/></Timeout><Act name="b"/></Sequence>', a=[R, R, R, R, S], b=[S], ticks=10, pause=60),
    case('timeout in time', '<Fallback><Timeout msec="150"><Act name="a"/></Timeout><Act name="b"/></Fallback>', a=[R, F, R, S], b=[R, S], ticks=10, pause=60),
]
# fmt: on
"""The trees of our own writing."""
