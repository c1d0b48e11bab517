"""Layered drawing of directed graphs (Sugiyama, Tagawa, Toda 1981): boxes and links in, places and routes out."""
