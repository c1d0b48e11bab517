from domains.clean_up_table.deployment import CleanUpTable as CleanUpTable
from domains.clean_up_table.deployment import deploy as deploy
from domains.clean_up_table.report import Report as Report
from domains.clean_up_table.scenario import Scenario as Scenario
from domains.clean_up_table.table_world import TableWorld as TableWorld
