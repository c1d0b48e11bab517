from domains.clean_up_table.bringup import bundle as bundle
from domains.clean_up_table.bringup import deploy as deploy
from domains.clean_up_table.bringup import world_of as world_of
from domains.clean_up_table.scenario import Scenario as Scenario
from domains.clean_up_table.table_world import TableWorld as TableWorld
