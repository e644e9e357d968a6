"""Ports for other programs: in-process links, pseudo-terminals, TCP sockets, RFC 2217, GDB."""
