from domains.butler.bringup import ButlerFlat as ButlerFlat
from domains.butler.bringup import bundle as bundle
from domains.butler.flat import Flat as Flat
from domains.butler.scenario import Scenario as Scenario
from domains.butler.speech import Speech as Speech
