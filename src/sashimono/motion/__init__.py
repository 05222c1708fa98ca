"""Level 2: a collision-free motion for each part, from its resting pose to its assembled pose."""

from sashimono.motion.config import MotionConfig, RestingConfig, RRTConfig, SmoothingConfig, TableConfig, TrayConfig
from sashimono.motion.plan_motions import MotionResult, plan_motions
from sashimono.motion.resting import StablePose, stable_poses
from sashimono.motion.rrt_connect import RRTResult, rrt_connect

__all__ = [
    "MotionConfig",
    "MotionResult",
    "RRTConfig",
    "RRTResult",
    "RestingConfig",
    "SmoothingConfig",
    "StablePose",
    "TableConfig",
    "TrayConfig",
    "plan_motions",
    "rrt_connect",
    "stable_poses",
]
