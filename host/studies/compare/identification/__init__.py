"""Methods of star identification."""
