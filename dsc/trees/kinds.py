"""The kinds of nodes of BehaviorTree.CPP that are supported: role, ports, number of children."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dsc.trees.model import Port, Role

INTEGER, NUMBER, BOOLEAN, TEXT, SCRIPT, STATUS, KEY = "int", "double", "bool", "text", "script", "status", "key"
"""Types of the ports of supported kinds; a port of type `script` or `status` contains no key of the blackboard."""


@dataclass(frozen=True, slots=True)
class Kind:
    """A supported kind of node: its role, its ports by name, and the least and greatest number of children."""

    role: Role
    ports: Mapping[str, Port]
    least: int = 0
    most: int | None = 0


def _ports(*declared: tuple[str, str, str | None]) -> dict[str, Port]:
    return {name: Port(name, "inout" if kind == KEY else "input", kind, default) for name, kind, default in declared}


def _control(*ports: tuple[str, str, str | None], least: int = 1, most: int | None = None) -> Kind:
    return Kind("control", _ports(*ports), least, most)


def _decorator(*ports: tuple[str, str, str | None]) -> Kind:
    return Kind("decorator", _ports(*ports), 1, 1)


def _switch(cases: int) -> Kind:
    ports = [("variable", TEXT, None), *((f"case_{number}", TEXT, None) for number in range(1, cases + 1))]
    return _control(*ports, least=cases + 1, most=cases + 1)


OF_NAV2: Mapping[str, Kind] = {
    "RecoveryNode": _control(("number_of_retries", INTEGER, "1"), least=2, most=2),
    "PipelineSequence": _control(),
    "RoundRobin": _control(("wrap_around", BOOLEAN, "false")),
    "RateController": _decorator(("hz", NUMBER, "10.0")),
}
"""The kinds of Nav2 that are supported, by name."""
KINDS: Mapping[str, Kind] = {
    **{
        name: _control()
        for name in (
            "Sequence",
            "AsyncSequence",
            "SequenceWithMemory",
            "ReactiveSequence",
            "Fallback",
            "AsyncFallback",
            "ReactiveFallback",
        )
    },
    "Parallel": _control(("success_count", INTEGER, "-1"), ("failure_count", INTEGER, "1")),
    "ParallelAll": _control(("max_failures", INTEGER, "1")),
    "IfThenElse": _control(least=2, most=3),
    "WhileDoElse": _control(least=2, most=3),
    **{f"Switch{cases}": _switch(cases) for cases in range(2, 7)},
    **{name: _decorator() for name in ("Inverter", "ForceSuccess", "ForceFailure", "KeepRunningUntilFailure")},
    "Repeat": _decorator(("num_cycles", INTEGER, None)),
    "RetryUntilSuccessful": _decorator(("num_attempts", INTEGER, None)),
    "Delay": _decorator(("delay_msec", INTEGER, None)),
    "Timeout": _decorator(("msec", INTEGER, None)),
    "RunOnce": _decorator(("then_skip", BOOLEAN, "true")),
    "Precondition": _decorator(("if", SCRIPT, None), ("else", STATUS, "FAILURE")),
    "SubTree": Kind("subtree", {}),
    "AlwaysSuccess": Kind("action", {}),
    "AlwaysFailure": Kind("action", {}),
    "Sleep": Kind("action", _ports(("msec", INTEGER, None))),
    "Script": Kind("action", _ports(("code", SCRIPT, None))),
    "SetBlackboard": Kind("action", _ports(("value", TEXT, None), ("output_key", KEY, None))),
    "UnsetBlackboard": Kind("action", _ports(("key", KEY, None))),
    "ScriptCondition": Kind("condition", _ports(("code", SCRIPT, None))),
    **OF_NAV2,
}
"""The supported kinds by name."""
SCRIPTS = ("_failureIf", "_successIf", "_skipIf", "_while", "_onSuccess", "_onFailure", "_onHalted", "_post")
"""Attributes of any node that contain a script, in the order of BehaviorTree.CPP."""
NO_COUNTERPART: Mapping[str, str] = {
    "TryCatch": "write a Fallback whose last child cleans up, inside ForceFailure",
    "ManualSelector": "write a Switch on an entry of the blackboard",
    "LoopInt": "write Repeat with an index in a Script",
    "LoopBool": "write Repeat with an index in a Script",
    "LoopDouble": "write Repeat with an index in a Script",
    "LoopString": "write Repeat with an index in a Script",
    "ConsumeQueue": "write an action that takes the next value",
    "WasEntryUpdated": "compare the entry with a former value in a ScriptCondition",
    "SkipUnlessUpdated": "write _skipIf with a comparison",
    "WaitValueUpdate": "write an action that waits for the value",
    "BlackboardCheckInt": "write Precondition with a comparison",
    "BlackboardCheckDouble": "write Precondition with a comparison",
    "BlackboardCheckString": "write Precondition with a comparison",
    "BlackboardCheckBool": "write Precondition with a comparison",
    "FallbackStar": "write Fallback",
    "NonblockingSequence": "write Parallel",
    "PersistentSequence": "write Switch on an entry of the blackboard, and count it in a Script",
    "PauseResumeController": "write WhileDoElse with a condition that tells whether the robot is paused",
    "GoalUpdater": "write an action that updates the goal, in a Sequence before the child",
    "GoalUpdatedController": "write Fallback with a condition that the goal is unchanged, before the child",
    "DistanceController": "write Fallback with a condition that the robot has not yet driven so far, before the child",
    "SpeedController": "write Fallback with a condition that the child is not yet due, before the child",
    "PathLongerOnApproach": "write Sequence with a condition that the path is longer, before the child",
}
"""Remedies for the kinds of BehaviorTree.CPP and of Nav2 that have no counterpart here."""
