"""Recordings from the host's side: made, played back, and how a device was set up."""
