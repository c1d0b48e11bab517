"""Clean up a table: cups nest and go to the sink, cans go into crisp cans and into the bin."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
