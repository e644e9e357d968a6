"""GDB's remote serial protocol, independent of sockets: packets, and a session on a target."""
