"""A node on the satellite's buses: link to the host, queue, settings, flags; no sensor in it."""
