"""Public names of package `dsc`: state charts, their run time, and the choice among plots with its reasons."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
