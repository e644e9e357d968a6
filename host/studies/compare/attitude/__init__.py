"""Methods of attitude determination."""
