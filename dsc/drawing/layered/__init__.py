"""Layered drawing of directed graphs (Sugiyama, Tagawa, Toda 1981): computes places of boxes and routes of links."""
