"""Level 2: a collision-free motion for each part, from its resting pose to its assembled pose."""

from sashimono.motion.config import (
    MotionConfig,
    RestingConfig,
    RRTConfig,
    SmoothingConfig,
    SpeedLimits,
    TableConfig,
    TrajectoryConfig,
    TrayConfig,
)
from sashimono.motion.plan_motions import MotionResult, plan_motions
from sashimono.motion.resting import StablePose, stable_poses
from sashimono.motion.rrt_connect import RRTResult, rrt_connect
from sashimono.motion.trajectory import Trajectory, time_path

__all__ = [
    "MotionConfig",
    "MotionResult",
    "RRTConfig",
    "RRTResult",
    "RestingConfig",
    "SmoothingConfig",
    "SpeedLimits",
    "StablePose",
    "TableConfig",
    "Trajectory",
    "TrajectoryConfig",
    "TrayConfig",
    "plan_motions",
    "rrt_connect",
    "stable_poses",
    "time_path",
]
