"""The ready world butler: spoken commands in a simulated flat."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
