"""GDB's remote serial protocol: packets, and a session that acts on a target. Knows no socket."""
