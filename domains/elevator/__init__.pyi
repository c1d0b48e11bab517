from domains.elevator.bringup import bundle as bundle
from domains.elevator.scenario import Scenario as Scenario
