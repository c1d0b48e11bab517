"""The world model: typed things, facts and numbers in a graph, asked in one language."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
