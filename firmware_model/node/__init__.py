"""A node on the satellite's buses, for any sensor: link to the host, queue, settings, flags."""
