"""The wire: components in other processes, over a transport of frames without guarantees."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
