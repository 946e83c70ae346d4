"""Shaders that others would write, measured beside raymarch."""
