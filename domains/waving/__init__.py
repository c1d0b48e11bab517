"""The ready world waving: one plot waves with two simulated arms, and with any arm that has a driver."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
