"""Records, replays and traces the traffic on the ports."""
