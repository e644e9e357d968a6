"""Diagrams as SVG, in light and dark colours."""
