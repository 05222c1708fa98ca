"""What the tests of the server send."""

import io
import zipfile

import numpy as np
import trimesh

END = ("complete", "partial", "failed", "cancelled")


def two_blocks() -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as out:
        for name, height in (("lower", 0.0), ("upper", 10.0)):
            mesh = trimesh.creation.box([20.0, 20.0, 10.0])
            mesh.apply_translation(np.array([0.0, 0.0, height]))
            out.writestr(f"{name}.obj", trimesh.exchange.obj.export_obj(mesh))
    return packed.getvalue()
