"""Looking at a plan: a self-contained HTML viewer and an animated glTF file; and at why a part is stuck."""

from sashimono.view.config import ViewConfig
from sashimono.view.explanation import write_explanation
from sashimono.view.glb import write_glb
from sashimono.view.html import write_html

__all__ = ["ViewConfig", "write_explanation", "write_glb", "write_html"]
