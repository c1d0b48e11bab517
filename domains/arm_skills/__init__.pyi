from domains.arm_skills.arm import Arm as Arm
from domains.arm_skills.bringup import bundle as bundle
from domains.arm_skills.driver import JointDriver as JointDriver
from domains.arm_skills.kinematics import Chain as Chain
from domains.arm_skills.kinematics import Joint as Joint
from domains.arm_skills.simulated_joints import SimulatedJoints as SimulatedJoints
