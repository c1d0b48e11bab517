"""The world model: typed things, facts and numbers in a graph, asked in one language."""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base._lazy import lazy_exports

if TYPE_CHECKING:
    from knowledge_base.conditions.condition import Condition as Condition
    from knowledge_base.conditions.condition import Firing as Firing
    from knowledge_base.conditions.damping import TimerClock as TimerClock
    from knowledge_base.conditions.watch import Missed as Missed
    from knowledge_base.conditions.watch import Watch as Watch
    from knowledge_base.errors import ConditionCancelledError as ConditionCancelledError
    from knowledge_base.errors import ConflictError as ConflictError
    from knowledge_base.errors import DamagedStoreError as DamagedStoreError
    from knowledge_base.errors import HistoryError as HistoryError
    from knowledge_base.errors import InputError as InputError
    from knowledge_base.errors import OutOfBoundsError as OutOfBoundsError
    from knowledge_base.errors import ParseError as ParseError
    from knowledge_base.errors import Place as Place
    from knowledge_base.errors import SchemaError as SchemaError
    from knowledge_base.errors import SchemaMismatchError as SchemaMismatchError
    from knowledge_base.errors import StoreError as StoreError
    from knowledge_base.errors import UnknownNameError as UnknownNameError
    from knowledge_base.errors import UnsupportedConstructError as UnsupportedConstructError
    from knowledge_base.facts import Change as Change
    from knowledge_base.facts import Content as Content
    from knowledge_base.facts import Delta as Delta
    from knowledge_base.facts import Fact as Fact
    from knowledge_base.facts import Value as Value
    from knowledge_base.facts import fact as fact
    from knowledge_base.language.explanation import Explanation as Explanation
    from knowledge_base.language.parser import parse_condition as parse_condition
    from knowledge_base.language.parser import parse_effect as parse_effect
    from knowledge_base.language.printer import to_text as to_text
    from knowledge_base.language.query_plan import QueryPlan as QueryPlan
    from knowledge_base.language.query_plan import QueryStep as QueryStep
    from knowledge_base.language.question_bounds import Bounds as Bounds
    from knowledge_base.language.vocabulary import Signature as Signature
    from knowledge_base.pddl.problem_text import read_problem as read_problem
    from knowledge_base.prepared import Binding as Binding
    from knowledge_base.sources import DataSource as DataSource
    from knowledge_base.store import KnowledgeBase as KnowledgeBase
    from knowledge_base.transaction import Transaction as Transaction
    from knowledge_base.view import View as View
    from knowledge_base.world.computation import Computed as Computed
    from knowledge_base.world.computation import computed as computed
    from knowledge_base.world.overlay import Overlay as Overlay
    from knowledge_base.world.schema import Schema as Schema
    from knowledge_base.world.state import WorldState as WorldState

__getattr__, __dir__, __all__ = lazy_exports(
    __name__,
    {
        "Binding": "prepared",
        "Bounds": "language.question_bounds",
        "Change": "facts",
        "Computed": "world.computation",
        "Condition": "conditions.condition",
        "ConditionCancelledError": "errors",
        "ConflictError": "errors",
        "Content": "facts",
        "DamagedStoreError": "errors",
        "DataSource": "sources",
        "Delta": "facts",
        "Explanation": "language.explanation",
        "Fact": "facts",
        "Firing": "conditions.condition",
        "HistoryError": "errors",
        "InputError": "errors",
        "KnowledgeBase": "store",
        "Missed": "conditions.watch",
        "OutOfBoundsError": "errors",
        "Overlay": "world.overlay",
        "ParseError": "errors",
        "Place": "errors",
        "QueryPlan": "language.query_plan",
        "QueryStep": "language.query_plan",
        "Schema": "world.schema",
        "SchemaError": "errors",
        "SchemaMismatchError": "errors",
        "Signature": "language.vocabulary",
        "StoreError": "errors",
        "TimerClock": "conditions.damping",
        "Transaction": "transaction",
        "UnknownNameError": "errors",
        "UnsupportedConstructError": "errors",
        "Value": "facts",
        "View": "view",
        "Watch": "conditions.watch",
        "WorldState": "world.state",
        "computed": "world.computation",
        "fact": "facts",
        "parse_condition": "language.parser",
        "parse_effect": "language.parser",
        "read_problem": "pddl.problem_text",
        "to_text": "language.printer",
    },
)
