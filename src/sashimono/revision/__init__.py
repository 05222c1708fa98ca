"""Two revisions of a product, or two plans: what changed, and whether the old plan still works."""

from sashimono.revision.compare import Revision, compare
from sashimono.revision.report import revision_as_dict, revision_lines
from sashimono.revision.sources import Side, read_side

__all__ = ["Revision", "Side", "compare", "read_side", "revision_as_dict", "revision_lines"]
