"""Scripts that draw the pictures of these documents, and hooks of their site."""
