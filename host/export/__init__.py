"""An interface for readers and other programs: text, Markdown, JSON, C header."""
