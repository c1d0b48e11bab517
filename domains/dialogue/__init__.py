"""Dialogue by arcs: a robot tells what to say and ask, and the answers become arcs (S4.5)."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
