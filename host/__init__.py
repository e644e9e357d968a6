"""Host side: transports, clients generated from the interface tables, and the command."""
