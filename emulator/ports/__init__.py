"""Where the outside world plugs in: in-process links, pseudo-terminals, TCP sockets, RFC 2217."""
