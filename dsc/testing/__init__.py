"""Tools for tests of plots: rehearsals, substitutes, predicates over steps, coverage; faults, crashes and invariants.

No other room of the project imports it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base._lazy import lazy_exports

if TYPE_CHECKING:
    from dsc.testing.answers import Answer as Answer
    from dsc.testing.answers import Call as Call
    from dsc.testing.coverage import Coverage as Coverage
    from dsc.testing.crashes import Crashes as Crashes
    from dsc.testing.dry_run import DryRun as DryRun
    from dsc.testing.faults import Fault as Fault
    from dsc.testing.faults import Faults as Faults
    from dsc.testing.interleaving import Interleaving as Interleaving
    from dsc.testing.invariants import Invariant as Invariant
    from dsc.testing.invariants import KeptRun as KeptRun
    from dsc.testing.invariants import claims_nothing_false as claims_nothing_false
    from dsc.testing.invariants import comes_to_an_end as comes_to_an_end
    from dsc.testing.invariants import executed_once as executed_once
    from dsc.testing.invariants import kept_run as kept_run
    from dsc.testing.invariants import knows as knows
    from dsc.testing.invariants import one_history as one_history
    from dsc.testing.invariants import replays as replays
    from dsc.testing.invariants import violations as violations
    from dsc.testing.lossy import LossyTransport as LossyTransport
    from dsc.testing.predicates import chose as chose
    from dsc.testing.predicates import configured as configured
    from dsc.testing.predicates import consumed as consumed
    from dsc.testing.predicates import emitted as emitted
    from dsc.testing.predicates import entered as entered
    from dsc.testing.predicates import exited as exited
    from dsc.testing.predicates import ignored as ignored
    from dsc.testing.predicates import started as started
    from dsc.testing.predicates import switched as switched
    from dsc.testing.predicates import told as told
    from dsc.testing.predicates import took as took
    from dsc.testing.predicates import trail as trail
    from dsc.testing.rehearsal import Rehearsal as Rehearsal
    from dsc.testing.rehearsal import rehearse as rehearse
    from dsc.testing.scripted import ScriptedSkills as ScriptedSkills
    from dsc.testing.stubs import ends_with as ends_with
    from dsc.testing.worlds import world as world

__getattr__, __dir__, __all__ = lazy_exports(
    __name__,
    {
        "Answer": "answers",
        "Call": "answers",
        "Coverage": "coverage",
        "Crashes": "crashes",
        "DryRun": "dry_run",
        "Fault": "faults",
        "Faults": "faults",
        "Interleaving": "interleaving",
        "Invariant": "invariants",
        "KeptRun": "invariants",
        "LossyTransport": "lossy",
        "Rehearsal": "rehearsal",
        "ScriptedSkills": "scripted",
        "chose": "predicates",
        "claims_nothing_false": "invariants",
        "comes_to_an_end": "invariants",
        "configured": "predicates",
        "consumed": "predicates",
        "emitted": "predicates",
        "ends_with": "stubs",
        "entered": "predicates",
        "executed_once": "invariants",
        "exited": "predicates",
        "ignored": "predicates",
        "kept_run": "invariants",
        "knows": "invariants",
        "one_history": "invariants",
        "rehearse": "rehearsal",
        "replays": "invariants",
        "started": "predicates",
        "switched": "predicates",
        "told": "predicates",
        "took": "predicates",
        "trail": "predicates",
        "violations": "invariants",
        "world": "worlds",
    },
)
