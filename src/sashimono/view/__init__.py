"""Looking at a plan (a self-contained HTML viewer, an animated glTF file), at why a part is stuck, at an input."""

from sashimono.view.config import ViewConfig
from sashimono.view.diagnosis import write_diagnosis
from sashimono.view.explanation import write_explanation
from sashimono.view.glb import write_glb
from sashimono.view.html import write_html

__all__ = ["ViewConfig", "write_diagnosis", "write_explanation", "write_glb", "write_html"]
