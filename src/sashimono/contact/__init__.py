"""Level 3: contacts. Antipodal grasps, their quality, and what the gripper must stay clear of."""

from sashimono.contact.clearance import Obstacle
from sashimono.contact.config import ContactConfig
from sashimono.contact.executable import Executability
from sashimono.contact.grasp import ContactChoice, choose_contact, choose_contacts
from sashimono.contact.gripper import PRESETS, Gripper, named_gripper, proportionate_gripper

__all__ = [
    "PRESETS",
    "ContactChoice",
    "ContactConfig",
    "Executability",
    "Gripper",
    "Obstacle",
    "choose_contact",
    "choose_contacts",
    "named_gripper",
    "proportionate_gripper",
]
