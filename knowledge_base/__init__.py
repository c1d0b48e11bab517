"""The world model: typed objects, facts and numbers in a graph, with one language for queries and changes."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
