"""The extended star tracker: what its sensors share, from a picture to a confirmed attitude."""
