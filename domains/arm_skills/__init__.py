"""Skills of any arm: a robot implements a driver of its joints, and uses the plots."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
