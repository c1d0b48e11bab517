"""Layered drawing of directed graphs (Sugiyama, Tagawa, Toda 1981): from boxes and links to places and routes."""
