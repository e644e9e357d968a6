"""The sensors that come with this distribution, each declared once for everything generic."""
