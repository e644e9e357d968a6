"""Recordings on the host's side: recorder, playback, and device set-ups."""
