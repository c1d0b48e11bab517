"""Attention by arcs: a robot tells what it wants to see, and looks at it in turn (S4.5)."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
