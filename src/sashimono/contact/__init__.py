"""Level 3: contacts. Antipodal grasps, their quality, what fingers must stay clear of, and pushes."""

from sashimono.contact.clearance import Obstacle
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

__all__ = [
    "FINGERTIPS",
    "PRESETS",
    "ContactChoice",
    "ContactConfig",
    "Executability",
    "Gripper",
    "Obstacle",
    "Tool",
    "choose_contact",
    "choose_contacts",
    "gripper_from_fields",
    "named_gripper",
    "proportionate_gripper",
]
