"""Interface tables: pure data that every room may import, and the codecs that follow from it."""
