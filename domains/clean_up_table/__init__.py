"""Clean up a table: cups nest and go to the sink, cans go into crisp cans and into the bin."""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base._lazy import lazy_exports

if TYPE_CHECKING:
    from domains.clean_up_table.deployment import CleanUpTable as CleanUpTable
    from domains.clean_up_table.deployment import deploy as deploy
    from domains.clean_up_table.report import Report as Report
    from domains.clean_up_table.scenario import Scenario as Scenario
    from domains.clean_up_table.table_world import TableWorld as TableWorld

__getattr__, __dir__, __all__ = lazy_exports(
    __name__,
    {
        "CleanUpTable": "deployment",
        "Report": "report",
        "Scenario": "scenario",
        "TableWorld": "table_world",
        "deploy": "deployment",
    },
)
