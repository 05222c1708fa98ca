"""A page to drop a file on: jobs in an embedded database, each planned by a process of its own."""

from sashimono.serve.limits import Limits

__all__ = ["Limits"]
