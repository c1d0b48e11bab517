from domains.waving.bringup import DeskArm as DeskArm
from domains.waving.bringup import HumanoidArm as HumanoidArm
from domains.waving.bringup import bundle as bundle
