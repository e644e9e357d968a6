"""client.py SOCKET PROGRAM: has the service run a program; ends with its exit status."""

import os
import socket
import sys

NO_ANSWER = 125

with socket.socket(socket.AF_UNIX) as service:
    service.connect(sys.argv[1])
    socket.send_fds(service, [os.fsencode(os.path.abspath(sys.argv[2]))], [1, 2])
    status = service.recv(1)
sys.exit(status[0] if status else NO_ANSWER)
