"""What passed on the ports, recorded, replayed and traced."""
