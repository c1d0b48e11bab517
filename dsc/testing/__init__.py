"""For tests of plots: rehearsals without a robot, stand-ins, questions about steps, and what was covered.

Nothing else of the project imports it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base._lazy import lazy_exports

if TYPE_CHECKING:
    from dsc.testing.answers import Answer as Answer
    from dsc.testing.answers import Call as Call
    from dsc.testing.coverage import Coverage as Coverage
    from dsc.testing.dry_run import DryRun as DryRun
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
        "DryRun": "dry_run",
        "Rehearsal": "rehearsal",
        "ScriptedSkills": "scripted",
        "chose": "predicates",
        "configured": "predicates",
        "consumed": "predicates",
        "emitted": "predicates",
        "ends_with": "stubs",
        "entered": "predicates",
        "exited": "predicates",
        "ignored": "predicates",
        "rehearse": "rehearsal",
        "started": "predicates",
        "switched": "predicates",
        "told": "predicates",
        "took": "predicates",
        "trail": "predicates",
        "world": "worlds",
    },
)
