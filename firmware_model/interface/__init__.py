"""Interface tables, pure data that every package may import, and the codecs derived from them."""
