"""Level 3: contacts. Antipodal grasps, their quality, what fingers must stay clear of, and pushes."""

from sashimono.contact.config import ContactConfig
from sashimono.contact.executable import Executability
from sashimono.contact.grasp import ContactChoice, choose_contact, choose_contacts
from sashimono.contact.gripper import (
    FINGERTIPS,
    PRESETS,
    Gripper,
    Tool,
    gripper_from_fields,
    named_gripper,
    proportionate_gripper,
)
from sashimono.contact.suction import REAL_TOOLS, VACUUM_CUP, SuctionCup, real_tool
from sashimono.motion.scene import Obstacle

__all__ = [
    "FINGERTIPS",
    "PRESETS",
    "REAL_TOOLS",
    "VACUUM_CUP",
    "ContactChoice",
    "ContactConfig",
    "Executability",
    "Gripper",
    "Obstacle",
    "SuctionCup",
    "Tool",
    "choose_contact",
    "choose_contacts",
    "gripper_from_fields",
    "named_gripper",
    "proportionate_gripper",
    "real_tool",
]
