"""Read a plan with nothing but NumPy: the order, where each part waits, how it goes in, and how it is held.

python examples/07_read_plan.py plan/plan.json
"""

import json
import sys

import numpy as np

with open(sys.argv[1], encoding="utf-8") as file:
    plan = json.load(file)
assembled = {part["name"]: np.array(part["T_world_part"]) for part in plan["parts"]}
for step in plan["steps"]:
    poses = np.array(step["path"]["T_world_part"])  # 4x4 each, in metres, the assembled pose last
    displacement = poses[0] @ np.linalg.inv(assembled[step["part"]])  # moves the input's geometry to where it waits
    held = step["contact"]["kind"] if step["contact"] else "not held"
    sys.stdout.write(
        f"{step['part']}: waits {np.round(1e3 * displacement[:3, 3], 1)} mm away, {len(poses)} poses, {held}\n"
    )
