"""The elevator challenge of the BICA paper, in a simulated house."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
